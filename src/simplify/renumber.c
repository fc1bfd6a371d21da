/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/renumber.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

bool renumbering_init(struct renumbering *renumbering, uint32_t before, bool (*is_left)(const void *context, uint32_t number),
                      const void *context)
{
    *renumbering = (struct renumbering){array_new(before, sizeof *renumbering->numbers), before, 0};
    for (uint32_t i = 0; i < before && renumbering->numbers; i++)
        renumbering->numbers[i] = is_left(context, i) ? renumbering->after++ : TETLOD_NONE;
    return renumbering->numbers;
}

void renumbering_fini(struct renumbering *renumbering)
{
    free(renumbering->numbers);
    *renumbering = (struct renumbering){0};
}

void renumber_array(void *array, size_t element_size, const struct renumbering *renumbering)
{
    char *elements;
    memcpy(&elements, array, sizeof elements);
    if (!elements)
        return;
    for (uint32_t i = 0; i < renumbering->before; i++) {
        uint32_t number = renumbering->numbers[i];
        if (number != TETLOD_NONE && number != i)
            memcpy(elements + number * element_size, elements + i * element_size, element_size);
    }
    elements = array_shrink(elements, renumbering->after, element_size);
    memcpy(array, &elements, sizeof elements);
}
