/* SPDX-License-Identifier: BSD-3-Clause */
/* Bytes that grow. */
#ifndef TETLOD_BUFFER_H
#define TETLOD_BUFFER_H

#include <stddef.h>
#include <stdint.h>

#include "format/common/sink.h"

struct buffer {
    unsigned char *bytes; /* owned */
    size_t size, capacity;
};

void buffer_fini(struct buffer *buffer);

TETLOD_CHECKED enum tetlod_status buffer_append(struct buffer *buffer, const void *bytes, size_t size);
/* As XML and HTML want it. */
TETLOD_CHECKED enum tetlod_status buffer_append_escaped(struct buffer *buffer, const char *text);
TETLOD_CHECKED enum tetlod_status buffer_printf(struct buffer *buffer, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Makes room for `size` more bytes and gives where they go. NULL: out of memory. */
unsigned char *buffer_extend(struct buffer *buffer, size_t size);

/* The same for bytes to come: they fit without growth. */
TETLOD_CHECKED enum tetlod_status buffer_reserve(struct buffer *buffer, uint64_t size, struct tetlod_error *error);

/* The buffer as a sink. */
struct tetlodi_sink buffer_sink(struct buffer *buffer);

#endif
