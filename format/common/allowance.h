/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a stream may ask for by its bytes (SPEC 2.3): so many things for each byte, and some that are free. An encoder
 * that has more appends zero bytes, which change nothing. Not installed.
 */
#ifndef TETLOD_ALLOWANCE_H
#define TETLOD_ALLOWANCE_H

#include <stdbool.h>
#include <stdint.h>

enum {
    PACKED_TABLE_FREE = 1 << 16,     /* bytes of a table that is packed: the index, TIME, TOPO */
    PACKED_TABLE_PER_BYTE = 3,
    PACKED_PER_BYTE = 64,     /* bytes of anything else that is packed */
    NUMBERS_FREE = 1 << 10,   /* vertices, tetrahedra or values that a part's frames give, up to a level */
    NUMBERS_PER_BYTE = 4,
    LABELS_FREE = 1 << 16,    /* labels of records, up to a level; of a field, times its components */
    LABELS_PER_BYTE = 16,     /* of geometry; ordinary streams have 2 to 11 */
    FIELD_LABELS_PER_BYTE = 512,
    LEVEL_ROWS_FREE = 1 << 22, /* vertices and tetrahedra of all levels, added up */
    LEVEL_ROWS_PER_BYTE = 256,
    PAGE_MODELS = 1 << 8,      /* what a page counts, up to a level: its models are made anew */
    PAGE_MODELS_FREE = 1 << 14,
    STEP_ROWS_FREE = 1 << 22, /* (vertices + tetrahedra) times components of all steps in all bands */
    STEP_ROWS_PER_BYTE = 64,
    MEMORY_FREE = 1 << 26,    /* bytes that a cursor or a series takes */
    MEMORY_PER_BYTE = 256,
    MAX_NAME = 255            /* bytes */
};

/* number <= base + per_byte * bytes, whatever they are. */
static inline bool is_within(uint64_t number, uint64_t base, uint64_t per_byte, uint64_t bytes)
{
    return number <= base || (number - base - 1) / per_byte < bytes;
}

/* base + per_byte * bytes, or the greatest number. */
static inline uint64_t limit_of(uint64_t base, uint64_t per_byte, uint64_t bytes)
{
    return bytes < (UINT64_MAX - base) / per_byte ? base + per_byte * bytes : UINT64_MAX;
}

#endif
