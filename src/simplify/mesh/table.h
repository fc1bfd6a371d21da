/* SPDX-License-Identifier: BSD-3-Clause */
/* A hash table of small numbers by key, that forgets all at once. */
#ifndef TETLOD_TABLE_H
#define TETLOD_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

static const uint64_t TABLE_FREE = ~(uint64_t)0;

struct table {
    uint64_t *keys; /* TABLE_FREE where there is none */
    uint32_t *values;
    size_t size, capacity; /* powers of two */
};

/* Forgets everything; room for `most` keys. False: no memory. */
bool table_clear(struct table *table, size_t most);
void table_fini(struct table *table);

static inline size_t table_place(const struct table *table, uint64_t key)
{
    size_t at = (size_t)(key * UINT64_C(0x9e3779b97f4a7c15) >> 32) & (table->size - 1);
    while (table->keys[at] != key && table->keys[at] != TABLE_FREE)
        at = (at + 1) & (table->size - 1);
    return at;
}

/* The value of the key, which is `value` if it was not there. */
static inline uint32_t *table_at(struct table *table, uint64_t key, uint32_t value)
{
    size_t at = table_place(table, key);
    if (table->keys[at] == TABLE_FREE) {
        table->keys[at] = key;
        table->values[at] = value;
    }
    return &table->values[at];
}

/* NULL if it is not there. */
static inline const uint32_t *table_find(const struct table *table, uint64_t key)
{
    size_t at = table_place(table, key);
    return table->keys[at] == TABLE_FREE ? NULL : &table->values[at];
}

#endif
