/* SPDX-License-Identifier: BSD-3-Clause */
/* A sink that keeps what is written, for tests. */
#ifndef TETLOD_MEMORY_SINK_H
#define TETLOD_MEMORY_SINK_H

#include "format/common/sink.h"

struct memory_sink {
    unsigned char *bytes; /* owned; free() */
    size_t size, capacity;
};

struct tetlodi_sink memory_sink(struct memory_sink *memory);

#endif
