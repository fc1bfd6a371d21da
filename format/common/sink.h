/* SPDX-License-Identifier: BSD-3-Clause */
/* Where bytes go that something writes: a file, memory, an answer. Not installed. */
#ifndef TETLOD_SINK_H
#define TETLOD_SINK_H

#include "format/tetlod.h"

/* Takes the next `size` bytes of the stream, in order. */
struct tetlodi_sink {
    enum tetlod_status (*write)(void *opaque, const void *bytes, size_t size);
    void *opaque;
};

#endif
