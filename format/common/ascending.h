/* SPDX-License-Identifier: BSD-3-Clause */
/* Lists of numbers in ascending order. Not installed. */
#ifndef TETLOD_ASCENDING_H
#define TETLOD_ASCENDING_H

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

static inline int ascending_compare(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

static inline void ascending_sort(uint32_t *list, size_t count)
{
    qsort(list, count, sizeof *list, ascending_compare);
}

/* How many in the list are below the number: its place, if it is there. */
static inline uint32_t ascending_place(const uint32_t *list, uint32_t count, uint32_t number)
{
    uint32_t low = 0;
    for (uint32_t high = count; low < high;) {
        uint32_t middle = low + (high - low) / 2;
        if (list[middle] < number)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

#endif
