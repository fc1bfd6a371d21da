/* SPDX-License-Identifier: BSD-3-Clause */
/* The 64 bytes that begin an HDF5 file with a stream in it, and say where that is (SPEC 3.10). Not installed. */
#ifndef TETLOD_POINTER_H
#define TETLOD_POINTER_H

#include <stdbool.h>

#include "format/common/checksum.h"
#include "format/tetlod.h"

enum { POINTER_SIZE = 64 };

#define TETLODI_POINTER_MAGIC "\x89TLH\r\n\x1a\n"

struct tetlodi_pointer {
    uint64_t offset, size; /* of the stream in the file */
};

void tetlodi_pointer_encode(const struct tetlodi_pointer *pointer, uint8_t out[POINTER_SIZE]);

bool tetlodi_pointer_is(const uint8_t bytes[POINTER_SIZE]);

/* ERR_CHECKSUM, ERR_STREAM. */
TETLOD_CHECKED enum tetlod_status tetlodi_pointer_decode(struct tetlodi_pointer *out, const uint8_t bytes[POINTER_SIZE],
                                                         struct tetlod_error *error);

#endif
