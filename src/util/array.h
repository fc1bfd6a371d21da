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

/* Such growth of an array of *capacity elements; 0 on failure, the array unchanged. */
int array_reserve(void **array, size_t *capacity, size_t needed, size_t element_size);

#endif
