/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/array.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

void *array_resize(void *array, size_t count, size_t element_size)
{
    if (element_size && count > SIZE_MAX / element_size)
        return NULL;
    size_t size = count * element_size;
    return realloc(array, size ? size : 1);
}

void *array_new(size_t count, size_t element_size)
{
    return array_resize(NULL, count, element_size);
}

void *array_zero(size_t count, size_t element_size)
{
    return calloc(count ? count : 1, element_size);
}

size_t array_growth(size_t capacity, size_t needed)
{
    size_t grown = capacity + capacity / 2 + 16;
    return grown < needed ? needed : grown;
}

int array_grow(void *array, size_t *capacity, size_t needed, size_t element_size)
{
    void *old;
    memcpy(&old, array, sizeof old);
    size_t grown = array_growth(*capacity, needed);
    void *moved = array_resize(old, grown, element_size);
    if (!moved)
        return 0;
    memcpy(array, &moved, sizeof moved);
    *capacity = grown;
    return 1;
}

void *array_shrink(void *array, size_t count, size_t element_size)
{
    void *smaller = array_resize(array, count, element_size);
    return smaller ? smaller : array;
}
