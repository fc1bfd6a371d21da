/* SPDX-License-Identifier: BSD-3-Clause */
/* A number for each unordered pair of vertices: lists by the smaller one. Where vertices that are near each other come
 * near each other, what is looked at stays in the cache, as it does not in a hash table. Zeroed, it is empty. */
#ifndef TETLOD_PAIRS_H
#define TETLOD_PAIRS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct pairs {
    uint32_t *first; /* [vertices] the newest entry of a smaller vertex, or TETLOD_NONE */
    struct pair {
        uint32_t larger, number, next;
    } *entries;
    size_t first_cap, entry_cap;
    uint32_t count;
};

/* Keeps the memory; vertices are below `vertex_count`. False: out of memory. */
bool pairs_clear(struct pairs *pairs, uint32_t vertex_count);
void pairs_fini(struct pairs *pairs);

/* Where the number of a pair is; *fresh: the caller has to set it. NULL: out of memory. Valid until the next call. */
uint32_t *pairs_at(struct pairs *pairs, uint32_t a, uint32_t b, bool *fresh);

#endif
