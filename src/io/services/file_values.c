/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/file_values.h"

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

/* A loop for each type of a file and each type of a result, so that the compiler makes of it what the machine can
 * do. */
#define LOAD(bits)                                                                                                     \
    static inline uint##bits##_t load_##bits(const unsigned char *bytes, bool swap)                                    \
    {                                                                                                                  \
        uint##bits##_t word;                                                                                           \
        memcpy(&word, bytes, sizeof word);                                                                             \
        return swap ? __builtin_bswap##bits(word) : word;                                                              \
    }
LOAD(16)
LOAD(32)
LOAD(64)

static inline uint8_t load_8(const unsigned char *bytes, bool swap)
{
    (void)swap;
    return *bytes;
}

static inline float load_float(const unsigned char *bytes, bool swap)
{
    uint32_t word = load_32(bytes, swap);
    float value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static inline double load_double(const unsigned char *bytes, bool swap)
{
    uint64_t word = load_64(bytes, swap);
    double value;
    memcpy(&value, &word, sizeof value);
    return value;
}

static inline int64_t int_of_uint64(uint64_t word)
{
    return word > INT64_MAX ? -1 : (int64_t)word;
}

static inline uint32_t point_of(int64_t value)
{
    return value < 0 || value > UINT32_MAX ? UINT32_MAX : (uint32_t)value;
}

static inline uint8_t byte_of(int64_t value)
{
    return value < 0 || value > UINT8_MAX ? UINT8_MAX : (uint8_t)value;
}

static inline double double_of(int64_t value)
{
    return (double)value;
}

static inline int64_t int_of(int64_t value)
{
    return value;
}

#define EACH(width, expression)                                                                                        \
    for (size_t i = 0; i < count; i++, bytes += width)                                                                 \
        out[i] = expression;                                                                                           \
    return;

#define INTEGER_CASES(convert)                                                                                         \
    case VALUE_INT8:                                                                                                   \
        EACH(1, convert((int8_t)load_8(bytes, swap)))                                                                  \
    case VALUE_UINT8:                                                                                                  \
        EACH(1, convert(load_8(bytes, swap)))                                                                          \
    case VALUE_INT16:                                                                                                  \
        EACH(2, convert((int16_t)load_16(bytes, swap)))                                                                \
    case VALUE_UINT16:                                                                                                 \
        EACH(2, convert(load_16(bytes, swap)))                                                                         \
    case VALUE_INT32:                                                                                                  \
        EACH(4, convert((int32_t)load_32(bytes, swap)))                                                                \
    case VALUE_UINT32:                                                                                                 \
        EACH(4, convert(load_32(bytes, swap)))                                                                         \
    case VALUE_INT64:                                                                                                  \
        EACH(8, convert((int64_t)load_64(bytes, swap)))

static bool must_swap(bool big_endian)
{
    return big_endian != (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__);
}

void values_to_doubles(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, double *out)
{
    bool swap = must_swap(big_endian);
    switch (type) {
        INTEGER_CASES(double_of)
    case VALUE_UINT64:
        EACH(8, (double)load_64(bytes, swap))
    case VALUE_FLOAT32:
        EACH(4, (double)load_float(bytes, swap))
    default:
        EACH(8, load_double(bytes, swap))
    }
}

#define INTEGERS(name, result, convert)                                                                                \
    void name(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, result *out)            \
    {                                                                                                                  \
        bool swap = must_swap(big_endian);                                                                             \
        switch (type) {                                                                                                \
            INTEGER_CASES(convert)                                                                                     \
        default:                                                                                                       \
            EACH(8, convert(int_of_uint64(load_64(bytes, swap))))                                                      \
        }                                                                                                              \
    }
INTEGERS(values_to_ints, int64_t, int_of)
INTEGERS(values_to_points, uint32_t, point_of)
INTEGERS(values_to_bytes, uint8_t, byte_of)

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

struct text text_word_past_comments(struct text *text)
{
    for (;;) {
        struct text word = text_word(text);
        if (word.at == word.end || *word.at != '#')
            return word;
        text->at = word.at;
        text_line(text);
    }
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

enum { MAX_DIGITS = 127 }; // more than any program writes for a double

/* The next word with a terminator, for strtod and its kin; false if it is empty or longer than a number can be. */
static bool number_word(struct text *text, char buffer[MAX_DIGITS + 1])
{
    struct text word = text_word(text);
    size_t length = (size_t)(word.end - word.at);
    if (length == 0 || length > MAX_DIGITS)
        return false;
    memcpy(buffer, word.at, length);
    buffer[length] = 0;
    return strlen(buffer) == length;
}

bool text_double(struct text *text, bool as_float, double *out)
{
    char buffer[MAX_DIGITS + 1], *end;
    if (!number_word(text, buffer))
        return false;
    *out = as_float ? (double)strtof(buffer, &end) : strtod(buffer, &end);
    return *end == 0;
}

bool text_int(struct text *text, int64_t *out)
{
    char buffer[MAX_DIGITS + 1], *end;
    if (!number_word(text, buffer))
        return false;
    errno = 0;
    long long value = strtoll(buffer, &end, 10);
    *out = value;
    return *end == 0 && errno == 0;
}
