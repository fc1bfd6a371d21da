/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/renumber.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

bool renumbering_init(struct renumbering *renumbering, uint32_t before, bool (*is_left)(const void *context, uint32_t number),
                      const void *context)
{
    size_t words = (size_t)before / 64 + 1;
    *renumbering = (struct renumbering){array_zero(words, sizeof(uint64_t)), array_new(words, sizeof(uint32_t)), before, 0};
    for (uint32_t i = 0; i < before && renumbering->left && renumbering->ranks; i++) {
        if (i % 64 == 0)
            renumbering->ranks[i / 64] = renumbering->after;
        if (!is_left(context, i))
            continue;
        renumbering->left[i / 64] |= (uint64_t)1 << i % 64;
        renumbering->after++;
    }
    return renumbering->left && renumbering->ranks;
}

void renumbering_fini(struct renumbering *renumbering)
{
    free(renumbering->left);
    free(renumbering->ranks);
    *renumbering = (struct renumbering){0};
}

void renumber_array(void *array, size_t element_size, const struct renumbering *renumbering)
{
    char *elements;
    memcpy(&elements, array, sizeof elements);
    if (!elements)
        return;
    size_t number = 0;
    for (uint32_t i = 0; i < renumbering->before; i++) {
        if (!(renumbering->left[i / 64] >> i % 64 & 1))
            continue;
        if (number != i)
            memcpy(elements + number * element_size, elements + i * element_size, element_size);
        number++;
    }
    elements = array_shrink(elements, renumbering->after, element_size);
    memcpy(array, &elements, sizeof elements);
}
