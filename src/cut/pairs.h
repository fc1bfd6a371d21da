/* SPDX-License-Identifier: BSD-3-Clause */
/* A number for each unordered pair of vertices: open addressing, at most half full. Zeroed, it is empty. */
#ifndef TETLOD_PAIRS_H
#define TETLOD_PAIRS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct pairs {
    uint64_t *keys; /* smaller vertex << 32 | larger vertex; all ones is free */
    uint32_t *numbers;
    size_t size, count;
};

/* Keeps the memory. */
void pairs_clear(struct pairs *pairs);
void pairs_fini(struct pairs *pairs);

/* Where the number of a pair is; *fresh: the caller has to set it. NULL: out of memory. Valid until the next call. */
uint32_t *pairs_at(struct pairs *pairs, uint32_t a, uint32_t b, bool *fresh);

#endif
