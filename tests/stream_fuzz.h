/* SPDX-License-Identifier: BSD-3-Clause */
/* What the fuzz targets of the stream have in common. */
#ifndef TETLOD_STREAM_FUZZ_H
#define TETLOD_STREAM_FUZZ_H

#include <stddef.h>
#include <stdint.h>

/* Opens, goes up as far as it can, down to the base and up again. Aborts if a state is not a mesh or if the two ways
 * differ. */
void stream_fuzz(const uint8_t *bytes, size_t size);

/* Sets the digests of frames and sections, where the index is not packed, the content id and the header's check to what
 * the bytes ask for, as far as they go. */
void stream_fuzz_seal(uint8_t *bytes, size_t size);

/* The same stream with an index that is not packed, so that a changed byte of it stays where it is. Allocated; NULL: no
 * stream. */
uint8_t *stream_fuzz_plain(const uint8_t *bytes, size_t size, size_t *out_size);

#endif
