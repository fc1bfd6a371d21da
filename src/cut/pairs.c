/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/pairs.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

#define FREE UINT64_MAX

void pairs_clear(struct pairs *pairs)
{
    if (pairs->count)
        memset(pairs->keys, 0xff, pairs->size * sizeof *pairs->keys);
    pairs->count = 0;
}

void pairs_fini(struct pairs *pairs)
{
    free(pairs->keys);
    free(pairs->numbers);
    *pairs = (struct pairs){0};
}

static size_t slot_of(const struct pairs *pairs, uint64_t key)
{
    size_t slot = (size_t)((key * 0x9e3779b97f4a7c15u) >> 32) & (pairs->size - 1);
    while (pairs->keys[slot] != FREE && pairs->keys[slot] != key)
        slot = (slot + 1) & (pairs->size - 1);
    return slot;
}

static bool grow(struct pairs *pairs)
{
    struct pairs larger = {.size = pairs->size ? 4 * pairs->size : 4096, .count = pairs->count};
    larger.keys = array_new(larger.size, sizeof *larger.keys);
    larger.numbers = array_new(larger.size, sizeof *larger.numbers);
    if (!larger.keys || !larger.numbers) {
        pairs_fini(&larger);
        return false;
    }
    memset(larger.keys, 0xff, larger.size * sizeof *larger.keys);
    for (size_t i = 0; i < pairs->size; i++)
        if (pairs->keys[i] != FREE) {
            size_t slot = slot_of(&larger, pairs->keys[i]);
            larger.keys[slot] = pairs->keys[i];
            larger.numbers[slot] = pairs->numbers[i];
        }
    pairs_fini(pairs);
    *pairs = larger;
    return true;
}

uint32_t *pairs_at(struct pairs *pairs, uint32_t a, uint32_t b, bool *fresh)
{
    uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
    if (2 * (pairs->count + 1) > pairs->size && !grow(pairs))
        return NULL;
    size_t slot = slot_of(pairs, key);
    *fresh = pairs->keys[slot] == FREE;
    pairs->keys[slot] = key;
    pairs->count += *fresh;
    return &pairs->numbers[slot];
}
