/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Numbers without gaps for what is left of tetrahedra or slots, so that what is gone leaves no room behind. They keep their order, by which ties
 * are broken: what is contracted does not depend on when they are renumbered.
 */
#ifndef TETLOD_RENUMBER_H
#define TETLOD_RENUMBER_H

#include <stdbool.h>

#include "format/tetlod.h"

struct renumbering {
    uint32_t *numbers; /* [before] the new number, or TETLOD_NONE: it is gone */
    uint32_t before, after;
};

/* Numbers that are left, of which `is_left` says true. False: no memory. */
bool renumbering_init(struct renumbering *renumbering, uint32_t before, bool (*is_left)(const void *context, uint32_t number),
                      const void *context);
void renumbering_fini(struct renumbering *renumbering);

/* The new number of one that may be TETLOD_NONE. */
static inline uint32_t renumbered(const struct renumbering *renumbering, uint32_t number)
{
    return number == TETLOD_NONE ? number : renumbering->numbers[number];
}

/* Moves the elements of an array to their new numbers and gives back room. `array` points to its pointer, which may be NULL. */
void renumber_array(void *array, size_t element_size, const struct renumbering *renumbering);

#endif
