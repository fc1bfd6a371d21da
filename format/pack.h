/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Tables of bytes, packed with the stream's own range coder (SPEC 6.4): the index and large sections. A byte is often the one
 * of the row above; else it is coded under models of its place. Not installed.
 */
#ifndef TETLOD_PACK_H
#define TETLOD_PACK_H

#include "format/bytes.h"
#include "format/tetlod.h"

enum { MOST_PACKING = 256 }; /* plain bytes per packed byte: bounds what a small file can ask for */

/* Packs `size` bytes of rows of `stride`. False if that is not smaller, if it would break the bound, or for want of memory:
 * they are then stored as they are. `out` is empty before. */
bool tetlodi_pack(const uint8_t *bytes, size_t size, uint32_t stride, struct tetlodi_buffer *out);

/* Unpacks to `size` bytes at `out`. `size` is at most MOST_PACKING * packed_size: the caller has checked it. ERR_NOMEM, ERR_STREAM. */
TETLOD_CHECKED enum tetlod_status tetlodi_unpack(const uint8_t *packed, size_t packed_size, uint8_t *out, size_t size,
                                                 struct tetlod_error *error);

#endif
