/* SPDX-License-Identifier: BSD-3-Clause */
/* What the fuzz targets of the stream have in common. */
#ifndef TETLOD_STREAM_FUZZ_H
#define TETLOD_STREAM_FUZZ_H

#include <stddef.h>
#include <stdint.h>

/* Opens, goes up as far as it can, down to the base and up again. Aborts if a state is not a mesh or if the two ways differ. */
void stream_fuzz(const uint8_t *bytes, size_t size);

/* Sets the checksums of header, index and frames, and the content id, to what the bytes ask for, as far as they go. */
void stream_fuzz_seal(uint8_t *bytes, size_t size);

#endif
