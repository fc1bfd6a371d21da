/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/put.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

enum { BUFFER = 1 << 16 };

enum tetlod_status put_init(struct put *put, const struct tetlodi_sink *sink, bool big_endian,
                            struct tetlod_error *error)
{
    *put = (struct put){sink, big_endian, array_new(BUFFER, 1), 0, TETLOD_OK};
    return put->buffer ? TETLOD_OK : tetlodi_fail_nomem(error, "a buffer", BUFFER);
}

void put_flush(struct put *put)
{
    if (put->status == TETLOD_OK && put->used)
        put->status = put->sink->write(put->sink->opaque, put->buffer, put->used);
    put->used = 0;
}

enum tetlod_status put_finish(struct put *put)
{
    put_flush(put);
    free(put->buffer);
    put->buffer = NULL;
    return put->status;
}

void put_word(struct put *put, uint64_t word, size_t size)
{
    if (BUFFER - put->used < size)
        put_flush(put);
    for (size_t b = 0; b < size; b++)
        put->buffer[put->used++] = (unsigned char)(word >> 8 * (put->big_endian ? size - 1 - b : b));
}

void put_double(struct put *put, double value, enum tetlod_type type)
{
    if (type == TETLOD_FLOAT64) {
        uint64_t word;
        memcpy(&word, &value, sizeof word);
        put_word(put, word, sizeof word);
    } else {
        float narrow = (float)value;
        uint32_t word;
        memcpy(&word, &narrow, sizeof word);
        put_word(put, word, sizeof word);
    }
}

void put_bytes(struct put *put, const void *bytes, size_t size)
{
    if (size > BUFFER - put->used)
        put_flush(put);
    if (size <= BUFFER) {
        memcpy(put->buffer + put->used, bytes, size);
        put->used += size;
    } else if (put->status == TETLOD_OK) {
        put->status = put->sink->write(put->sink->opaque, bytes, size);
    }
}

void put_text(struct put *put, const char *text)
{
    put_bytes(put, text, strlen(text));
}

const char *xml_escape(char c)
{
    return c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : NULL;
}

void put_escaped(struct put *put, const char *text)
{
    for (; *text; text++)
        if (xml_escape(*text))
            put_text(put, xml_escape(*text));
        else
            put_word(put, (unsigned char)*text, 1);
}

void put_format(struct put *put, const char *format, ...)
{
    char text[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    put_text(put, text);
}
