/* SPDX-License-Identifier: BSD-3-Clause */
/* Arrays of numbers as few bytes, for files that are read once: each number as what it is more than an earlier one. */
#ifndef TETLOD_PACKED_WORDS_H
#define TETLOD_PACKED_WORDS_H

#include <stdbool.h>

#include "src/util/buffer.h"

/* Bytes that are left to be read. */
struct words_source {
    const unsigned char *at;
    size_t left;
};

/* Appends `count` numbers of `width` bytes: 4, as differences from the one `lag` before; 8, doubles, as the bytes in
 * which they differ from it; 1, as they are. False: no memory. */
bool words_put(struct buffer *out, const void *words, size_t count, unsigned width, unsigned lag);

/* Could so many numbers be in so many bytes? */
bool words_fit(size_t count, unsigned width, size_t bytes);

/* Takes them out again. False: the bytes are of something else. */
bool words_get(struct words_source *source, void *words, size_t count, unsigned width, unsigned lag);

#endif
