/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Tables of bytes, packed with the stream's own range coder (SPEC 6.4): the index and large sections. A byte is often
 * the one of the row above; else it is coded under models of its place. Not installed.
 */
#ifndef TETLOD_PACK_H
#define TETLOD_PACK_H

#include "format/common/bytes.h"
#include "format/tetlod.h"

/* What is packed: rows of digests, which hardly pack, or anything else. */
enum tetlodi_packing { PACKED_TABLE, PACKED_VALUES };

/* Can so many packed bytes hold so many plain ones (SPEC 2.3)? */
bool tetlodi_packs(enum tetlodi_packing packing, uint64_t plain, uint64_t packed);

/* Packs `size` bytes of rows of `stride`. False if that is not smaller, or for want of memory: they are then stored as
 * they are. `out` is empty before. */
bool tetlodi_pack(enum tetlodi_packing packing, const uint8_t *bytes, size_t size, uint32_t stride,
                  struct tetlodi_buffer *out);

/* Unpacks to `size` bytes at `out`, of which the caller has checked that they fit. ERR_NOMEM, ERR_STREAM. */
TETLOD_CHECKED enum tetlod_status tetlodi_unpack(const uint8_t *packed, size_t packed_size, uint8_t *out, size_t size,
                                                 struct tetlod_error *error);

#endif
