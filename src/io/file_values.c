/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/file_values.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

size_t value_size(enum value_type type)
{
    static const uint8_t sizes[VALUE_TYPES] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return sizes[type];
}

bool value_is_float(enum value_type type)
{
    return type == VALUE_FLOAT32 || type == VALUE_FLOAT64;
}

static uint64_t load(const unsigned char *bytes, size_t size, bool big_endian)
{
    uint64_t word = 0;
    for (size_t b = 0; b < size; b++)
        word |= (uint64_t)bytes[b] << 8 * (big_endian ? size - 1 - b : b);
    return word;
}

static int64_t as_int(uint64_t word, enum value_type type)
{
    switch (type) {
    case VALUE_INT8:
        return (int8_t)word;
    case VALUE_INT16:
        return (int16_t)word;
    case VALUE_INT32:
        return (int32_t)word;
    case VALUE_UINT64:
        return word > INT64_MAX ? -1 : (int64_t)word;
    default:
        return (int64_t)word;
    }
}

static double as_double(uint64_t word, enum value_type type)
{
    if (type == VALUE_FLOAT32) {
        uint32_t bits = (uint32_t)word;
        float value;
        memcpy(&value, &bits, sizeof value);
        return (double)value;
    }
    if (type == VALUE_FLOAT64) {
        double value;
        memcpy(&value, &word, sizeof value);
        return value;
    }
    return type == VALUE_UINT64 ? (double)word : (double)as_int(word, type);
}

void values_to_doubles(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, double *out)
{
    size_t size = value_size(type);
    for (size_t i = 0; i < count; i++)
        out[i] = as_double(load(bytes + i * size, size, big_endian), type);
}

void values_to_ints(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, int64_t *out)
{
    size_t size = value_size(type);
    for (size_t i = 0; i < count; i++)
        out[i] = as_int(load(bytes + i * size, size, big_endian), type);
}

static bool is_space(char c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

struct text text_word(struct text *text)
{
    while (text->at < text->end && is_space(*text->at))
        text->at++;
    struct text word = {text->at, text->at};
    while (text->at < text->end && !is_space(*text->at))
        text->at++;
    word.end = text->at;
    return word;
}

bool text_is(struct text word, const char *name)
{
    size_t length = strlen(name);
    return (size_t)(word.end - word.at) == length && strncasecmp(word.at, name, length) == 0;
}

int text_length(struct text word)
{
    return word.end - word.at < 40 ? (int)(word.end - word.at) : 40;
}

struct text text_line(struct text *text)
{
    struct text line = *text;
    const char *newline = text->at < text->end ? memchr(text->at, '\n', (size_t)(text->end - text->at)) : NULL;
    line.end = newline ? newline : text->end;
    text->at = newline ? newline + 1 : text->end;
    if (line.end > line.at && line.end[-1] == '\r')
        line.end--;
    return line;
}

enum { MOST_DIGITS = 127 }; // more than any program writes for a double

/* The next word with a terminator, for strtod and its kin; false if it is empty or longer than a number can be. */
static bool number_word(struct text *text, char buffer[MOST_DIGITS + 1])
{
    struct text word = text_word(text);
    size_t length = (size_t)(word.end - word.at);
    if (length == 0 || length > MOST_DIGITS)
        return false;
    memcpy(buffer, word.at, length);
    buffer[length] = 0;
    return strlen(buffer) == length;
}

bool text_double(struct text *text, bool as_float, double *out)
{
    char buffer[MOST_DIGITS + 1], *end;
    if (!number_word(text, buffer))
        return false;
    *out = as_float ? (double)strtof(buffer, &end) : strtod(buffer, &end);
    return *end == 0;
}

bool text_int(struct text *text, int64_t *out)
{
    char buffer[MOST_DIGITS + 1], *end;
    if (!number_word(text, buffer))
        return false;
    errno = 0;
    long long value = strtoll(buffer, &end, 10);
    *out = value;
    return *end == 0 && errno == 0;
}
