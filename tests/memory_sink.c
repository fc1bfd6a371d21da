/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/memory_sink.h"

#include <string.h>

#include "src/util/array.h"

static enum tetlod_status write_memory(void *opaque, const void *bytes, size_t size)
{
    struct memory_sink *memory = opaque;
    if (!ARRAY_RESERVE(memory->bytes, memory->capacity, memory->size + size))
        return TETLOD_ERR_NOMEM;
    memcpy(memory->bytes + memory->size, bytes, size);
    memory->size += size;
    return TETLOD_OK;
}

struct tetlodi_sink memory_sink(struct memory_sink *memory)
{
    return (struct tetlodi_sink){write_memory, memory};
}
