/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/pairs.h"

#include <stdlib.h>

#include "format/tetlod.h"
#include "src/util/array.h"

bool pairs_clear(struct pairs *pairs, uint32_t vertex_count)
{
    pairs->count = 0;
    if (!ARRAY_RESERVE(pairs->first, pairs->first_cap, vertex_count))
        return false;
    for (uint32_t v = 0; v < vertex_count; v++)
        pairs->first[v] = TETLOD_NONE;
    return true;
}

void pairs_fini(struct pairs *pairs)
{
    free(pairs->first);
    free(pairs->entries);
    *pairs = (struct pairs){0};
}

uint32_t *pairs_at(struct pairs *pairs, uint32_t a, uint32_t b, bool *fresh)
{
    uint32_t low = a < b ? a : b, high = a < b ? b : a;
    *fresh = false;
    for (uint32_t entry = pairs->first[low]; entry != TETLOD_NONE; entry = pairs->entries[entry].next)
        if (pairs->entries[entry].larger == high)
            return &pairs->entries[entry].number;
    if (!ARRAY_RESERVE(pairs->entries, pairs->entry_cap, (size_t)pairs->count + 1))
        return NULL;
    *fresh = true;
    struct pair *pair = &pairs->entries[pairs->count];
    *pair = (struct pair){.larger = high, .next = pairs->first[low]};
    pairs->first[low] = pairs->count++;
    return &pair->number;
}
