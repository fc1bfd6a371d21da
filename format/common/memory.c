/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/common/memory.h"

#include <stdlib.h>

#include "format/fail.h"

/* Size 0 frees. */
static void *resize(const struct tetlodi_memory *memory, void *array, size_t size)
{
    if (memory->allocate)
        return memory->allocate(memory->opaque, array, size);
    if (size)
        return realloc(array, size);
    free(array);
    return NULL;
}

static int has_budget(struct tetlodi_memory *memory, uint64_t more)
{
    memory->over = more > memory->most - memory->used;
    return !memory->over;
}

int tetlodi_count(struct tetlodi_memory *memory, uint64_t bytes)
{
    if (!has_budget(memory, bytes))
        return 0;
    memory->used += bytes;
    return 1;
}

void *tetlodi_grow(struct tetlodi_memory *memory, void *array, size_t *capacity, size_t needed, size_t element_size)
{
    size_t room = *capacity + *capacity / 2 + 16;
    if (room < needed)
        room = needed;
    if (room > SIZE_MAX / element_size)
        return NULL;
    uint64_t more = (uint64_t)(room - *capacity) * element_size;
    if (!has_budget(memory, more))
        return NULL;
    void *grown = resize(memory, array, room * element_size);
    if (!grown)
        return NULL;
    memory->used += more;
    *capacity = room;
    return grown;
}

void tetlodi_release(struct tetlodi_memory *memory, void *array, size_t capacity, size_t element_size)
{
    if (array)
        resize(memory, array, 0);
    memory->used -= (uint64_t)capacity * element_size;
}

enum tetlod_status tetlodi_no_room(const struct tetlodi_memory *memory, struct tetlod_error *error)
{
    if (memory->over)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the stream needs more than the %llu bytes of memory allowed",
                            (unsigned long long)memory->most);
    return tetlodi_fail(error, TETLOD_ERR_NOMEM, "out of memory while decoding (%llu bytes in use)",
                        (unsigned long long)memory->used);
}
