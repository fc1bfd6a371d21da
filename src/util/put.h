/* SPDX-License-Identifier: BSD-3-Clause */
/* Small writes, gathered for a sink. */
#ifndef TETLOD_PUT_H
#define TETLOD_PUT_H

#include <stdbool.h>

#include "format/common/sink.h"

struct put {
    const struct tetlodi_sink *sink;
    bool big_endian;       /* of words */
    unsigned char *buffer; /* owned */
    size_t used;
    enum tetlod_status status; /* of the sink; nothing is written after a failure */
};

TETLOD_CHECKED enum tetlod_status put_init(struct put *put, const struct tetlodi_sink *sink, bool big_endian,
                                           struct tetlod_error *error);

/* Writes what is left, frees, and returns the sink's status. */
TETLOD_CHECKED enum tetlod_status put_finish(struct put *put);

/* Writes what is gathered so far. */
void put_flush(struct put *put);

void put_word(struct put *put, uint64_t word, size_t size);
void put_double(struct put *put, double value, enum tetlod_type type);
void put_bytes(struct put *put, const void *bytes, size_t size);
void put_text(struct put *put, const char *text);
void put_escaped(struct put *put, const char *text); /* as XML wants it */
void put_format(struct put *put, const char *format, ...) __attribute__((format(printf, 2, 3))); /* at most 255 bytes */

/* What stands for a character in XML and HTML, or NULL: itself. */
const char *xml_escape(char c);

#endif
