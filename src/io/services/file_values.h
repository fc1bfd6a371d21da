/* SPDX-License-Identifier: BSD-3-Clause */
/* Numbers as files hold them: binary of any width and byte order, or text. */
#ifndef TETLOD_FILE_VALUES_H
#define TETLOD_FILE_VALUES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum value_type {
    VALUE_INT8,
    VALUE_UINT8,
    VALUE_INT16,
    VALUE_UINT16,
    VALUE_INT32,
    VALUE_UINT32,
    VALUE_INT64,
    VALUE_UINT64,
    VALUE_FLOAT32,
    VALUE_FLOAT64,
    VALUE_TYPES
};

size_t value_size(enum value_type type);
bool value_is_float(enum value_type type);

/* `count` values of `type` from unaligned bytes. To int64_t: integer types only; a uint64 above INT64_MAX becomes -1,
 * which no use of an integer here accepts. */
void values_to_doubles(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, double *out);
void values_to_ints(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, int64_t *out);

/* Integers narrowed: what does not fit, also what is negative, becomes the largest number. */
void values_to_points(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, uint32_t *out);
void values_to_bytes(const unsigned char *bytes, enum value_type type, bool big_endian, size_t count, uint8_t *out);

/* Text that is read from `at` on. Never beyond `end`; there is no terminator. */
struct text {
    const char *at, *end;
};

/* The next run of characters that are not white space; its length is 0 at the end. */
struct text text_word(struct text *text);

/* The same, past comments: from a # that begins a word to the end of its line. */
struct text text_word_past_comments(struct text *text);

/* Whether `word` is `name`, whatever its case. */
bool text_is(struct text word, const char *name);

/* Its length, at most 40, for "%.*s" in a message. */
int text_length(struct text word);

/* The rest of the line, without its end; `text` goes on at the next line. */
struct text text_line(struct text *text);

/* The next number; false if there is none, the text is then after the word that is not one. `as_float` rounds once, to
 * float32. */
bool text_double(struct text *text, bool as_float, double *out);
bool text_int(struct text *text, int64_t *out);

#endif
