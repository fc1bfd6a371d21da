/* SPDX-License-Identifier: BSD-3-Clause */
/* Disjoint sets of numbers. parent[i] = i to begin with; the root of a set is its least number. */
#ifndef TETLOD_UNION_FIND_H
#define TETLOD_UNION_FIND_H

#include <stdbool.h>
#include <stdint.h>

static inline uint32_t find_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i)
        i = parent[i] = parent[parent[i]];
    return i;
}

/* True if they were apart. */
static inline bool join_sets(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = find_root(parent, a);
    b = find_root(parent, b);
    parent[a > b ? a : b] = a > b ? b : a;
    return a != b;
}

#endif
