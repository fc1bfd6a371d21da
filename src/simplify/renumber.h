/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Numbers without gaps for what is left of tetrahedra or slots, so that what is gone leaves no room behind. They keep their order, by which ties
 * are broken: what is contracted does not depend on when they are renumbered.
 */
#ifndef TETLOD_RENUMBER_H
#define TETLOD_RENUMBER_H

#include <stdbool.h>

#include "format/tetlod.h"

/* In little room, as it is made where a build takes the most memory. */
struct renumbering {
    uint64_t *left;  /* set of the numbers that are left */
    uint32_t *ranks; /* [word of the set] how many are left before it */
    uint32_t before, after;
};

/* Numbers that are left, of which `is_left` says true. False: no memory. */
bool renumbering_init(struct renumbering *renumbering, uint32_t before, bool (*is_left)(const void *context, uint32_t number),
                      const void *context);
void renumbering_fini(struct renumbering *renumbering);

/* The new number; TETLOD_NONE: it is gone, or was that. */
static inline uint32_t renumbered(const struct renumbering *renumbering, uint32_t number)
{
    if (number == TETLOD_NONE)
        return number;
    uint64_t word = renumbering->left[number / 64], bit = (uint64_t)1 << number % 64;
    return word & bit ? renumbering->ranks[number / 64] + (uint32_t)__builtin_popcountll(word & (bit - 1)) : TETLOD_NONE;
}

/* Moves the elements of an array to their new numbers and gives back room. `array` points to its pointer, which may be NULL. */
void renumber_array(void *array, size_t element_size, const struct renumbering *renumbering);

#endif
