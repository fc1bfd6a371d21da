/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/buffer.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/put.h"

void buffer_fini(struct buffer *buffer)
{
    free(buffer->bytes);
    *buffer = (struct buffer){0};
}

unsigned char *buffer_extend(struct buffer *buffer, size_t size)
{
    if (size > SIZE_MAX - buffer->size ||
        !ARRAY_RESERVE(buffer->bytes, buffer->capacity, buffer->size + size))
        return NULL;
    unsigned char *place = buffer->bytes + buffer->size;
    buffer->size += size;
    return place;
}

enum tetlod_status buffer_reserve(struct buffer *buffer, uint64_t size, struct tetlod_error *error)
{
    if (size <= SIZE_MAX - buffer->size &&
        ARRAY_RESERVE(buffer->bytes, buffer->capacity, buffer->size + (size_t)size))
        return TETLOD_OK;
    return tetlodi_fail_nomem(error, "an answer", size);
}

enum tetlod_status buffer_append(struct buffer *buffer, const void *bytes, size_t size)
{
    unsigned char *place = buffer_extend(buffer, size);
    if (!place)
        return TETLOD_ERR_NOMEM;
    if (size)
        memcpy(place, bytes, size);
    return TETLOD_OK;
}

enum tetlod_status buffer_append_escaped(struct buffer *buffer, const char *text)
{
    for (; *text; text++) {
        const char *escape = xml_escape(*text);
        TETLOD_TRY(buffer_append(buffer, escape ? escape : text, escape ? strlen(escape) : 1));
    }
    return TETLOD_OK;
}

enum tetlod_status buffer_printf(struct buffer *buffer, const char *format, ...)
{
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    int size = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);
    unsigned char *place = size >= 0 ? buffer_extend(buffer, (size_t)size + 1) : NULL;
    if (place) {
        vsnprintf((char *)place, (size_t)size + 1, format, again);
        buffer->size--; // without the NUL
    }
    va_end(again);
    return place ? TETLOD_OK : TETLOD_ERR_NOMEM;
}

static enum tetlod_status sink_write(void *opaque, const void *bytes, size_t size)
{
    return buffer_append(opaque, bytes, size);
}

struct tetlodi_sink buffer_sink(struct buffer *buffer)
{
    return (struct tetlodi_sink){sink_write, buffer};
}
