/* SPDX-License-Identifier: BSD-3-Clause */
/* Heap arrays within a budget of bytes. Not installed. */
#ifndef TETLOD_MEMORY_H
#define TETLOD_MEMORY_H

#include "format/tetlod.h"

struct tetlodi_memory {
    uint64_t used, most; /* bytes; most is the budget */
    void *(*allocate)(void *opaque, void *block, size_t size); /* as in tetlod_options */
    void *opaque;
    int over; /* what was asked for last is beyond the budget */
};

/* Counts `bytes` that are allocated elsewhere. 0 if they are beyond the budget: nothing is counted then. */
int tetlodi_count(struct tetlodi_memory *memory, uint64_t bytes);

/* Grows an array of *capacity elements so that `needed` fit, by half at least. The new array, or NULL with the old one
 * unchanged. */
void *tetlodi_grow(struct tetlodi_memory *memory, void *array, size_t *capacity, size_t needed, size_t element_size);

/* Frees an array of `capacity` elements. */
void tetlodi_release(struct tetlodi_memory *memory, void *array, size_t capacity, size_t element_size);

/* ERR_LIMIT or ERR_NOMEM, whichever kept tetlodi_grow from `bytes` more. */
enum tetlod_status tetlodi_no_room(const struct tetlodi_memory *memory, struct tetlod_error *error);

/* 1 if `array` has room for `needed` elements, after growing it if it had not. */
#define TETLODI_ROOM(memory, array, capacity, needed)                                                                  \
    ((needed) <= (capacity) || tetlodi_room_((memory), (void **)&(array), &(capacity), (needed), sizeof *(array)))

static inline int tetlodi_room_(struct tetlodi_memory *memory, void **array, size_t *capacity, size_t needed,
                                size_t size)
{
    void *old, *grown;
    __builtin_memcpy(&old, array, sizeof old);
    grown = tetlodi_grow(memory, old, capacity, needed, size);
    if (!grown)
        return 0;
    __builtin_memcpy(array, &grown, sizeof grown);
    return 1;
}

#define TETLODI_FREE(memory, array, capacity)                                                                          \
    (tetlodi_release((memory), (array), (capacity), sizeof *(array)), (array) = NULL, (capacity) = 0)

#endif
