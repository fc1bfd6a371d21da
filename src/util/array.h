/* SPDX-License-Identifier: BSD-3-Clause */
/* Heap arrays whose size cannot overflow. NULL means out of memory; a count of 0 gives a valid pointer. free()
 * frees. */
#ifndef TETLOD_ARRAY_H
#define TETLOD_ARRAY_H

#include <stddef.h>

void *array_new(size_t count, size_t element_size);  /* contents undefined */
void *array_zero(size_t count, size_t element_size); /* contents 0 */
void *array_resize(void *array, size_t count, size_t element_size); /* the old one stays valid on failure */

/* The array with less room; it cannot fail. */
void *array_shrink(void *array, size_t count, size_t element_size);

/* The capacity to which an array grows, by half at least, so that `needed` elements fit. */
size_t array_growth(size_t capacity, size_t needed);

/* Such growth of an array of *capacity elements, of which `array` is the address of the pointer. 0: out of memory, the
 * array unchanged. */
int array_grow(void *array, size_t *capacity, size_t needed, size_t element_size);

/* The same where there is not room already. */
static inline int array_reserve(void *array, size_t *capacity, size_t needed, size_t element_size)
{
    return needed <= *capacity || array_grow(array, capacity, needed, element_size);
}

/* Room for `needed` elements in an array of a known type. */
#define ARRAY_RESERVE(array, capacity, needed) array_reserve(&(array), &(capacity), (needed), sizeof *(array))

/* Appends a value, growing the array as needed. 0: out of memory. */
#define ARRAY_PUSH(array, count, capacity, value)                                                                      \
    (ARRAY_RESERVE(array, capacity, (size_t)(count) + 1) ? ((array)[(count)++] = (value), 1) : 0)

#endif
