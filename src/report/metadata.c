/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/metadata.h"

#include <stdint.h>
#include <string.h>

#include "format/utf8.h"

enum { MOST_DEPTH = 1024 }; /* of objects and arrays in each other: the stack is finite */

struct text {
    const char *at, *end;
};

static bool take(struct text *text, char wanted)
{
    bool there = text->at < text->end && *text->at == wanted;
    text->at += there;
    return there;
}

static bool take_word(struct text *text, const char *word)
{
    size_t length = strlen(word);
    bool there = (size_t)(text->end - text->at) >= length && memcmp(text->at, word, length) == 0;
    text->at += there ? length : 0;
    return there;
}

static void skip_space(struct text *text)
{
    while (text->at < text->end && memchr(" \t\n\r", *text->at, 4))
        text->at++;
}

static size_t take_digits(struct text *text)
{
    const char *begin = text->at;
    while (text->at < text->end && *text->at >= '0' && *text->at <= '9')
        text->at++;
    return (size_t)(text->at - begin);
}

static bool take_number(struct text *text)
{
    take(text, '-');
    if (!take(text, '0') && !take_digits(text))
        return false;
    if (take(text, '.') && !take_digits(text))
        return false;
    if (!take(text, 'e') && !take(text, 'E'))
        return true;
    if (!take(text, '+'))
        take(text, '-');
    return take_digits(text);
}

static bool take_hex(struct text *text, unsigned *out)
{
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    *out = 0;
    for (int i = 0; i < 4; i++) {
        const char *digit = text->at < text->end ? memchr(digits, *text->at++, 32) : NULL;
        if (!digit)
            return false;
        *out = 16 * *out + (unsigned)(digit - digits) % 16;
    }
    return true;
}

/* What follows a backslash. The two halves of a surrogate pair come together. */
static bool take_escape(struct text *text)
{
    unsigned code, second;
    if (!take(text, 'u'))
        return text->at < text->end && memchr("\"\\/bfnrt", *text->at++, 8);
    if (!take_hex(text, &code) || (code >= 0xdc00 && code < 0xe000))
        return false;
    return code < 0xd800 || code >= 0xe000 ||
           (take_word(text, "\\u") && take_hex(text, &second) && second >= 0xdc00 && second < 0xe000);
}

/* Well-formed UTF-8 with any character from U+0020 on. */
static bool take_character(struct text *text)
{
    uint32_t code;
    size_t length = tetlodi_utf8_length((const uint8_t *)text->at, (size_t)(text->end - text->at), &code);
    text->at += length;
    return length && code >= 0x20;
}

static bool take_string(struct text *text)
{
    if (!take(text, '"'))
        return false;
    while (text->at < text->end && *text->at != '"')
        if (take(text, '\\') ? !take_escape(text) : !take_character(text))
            return false;
    return take(text, '"');
}

static bool take_value(struct text *text, int depth);

/* After the bracket: members of an object, or elements of an array. */
static bool take_list(struct text *text, char close, int depth)
{
    skip_space(text);
    if (take(text, close))
        return true;
    do {
        skip_space(text);
        if (close == '}') {
            if (!take_string(text))
                return false;
            skip_space(text);
            if (!take(text, ':'))
                return false;
        }
        if (!take_value(text, depth))
            return false;
    } while (take(text, ','));
    return take(text, close);
}

static bool take_value(struct text *text, int depth)
{
    bool good;
    skip_space(text);
    if (take(text, '{'))
        good = depth > 0 && take_list(text, '}', depth - 1);
    else if (take(text, '['))
        good = depth > 0 && take_list(text, ']', depth - 1);
    else if (text->at < text->end && *text->at == '"')
        good = take_string(text);
    else
        good = take_word(text, "true") || take_word(text, "false") || take_word(text, "null") || take_number(text);
    skip_space(text);
    return good;
}

bool metadata_is_object(const char *text, size_t size)
{
    struct text rest = {text, text + size};
    skip_space(&rest);
    return rest.at < rest.end && *rest.at == '{' && take_value(&rest, MOST_DEPTH) && rest.at == rest.end;
}

json_t *metadata_json(const struct tetlod_info *info)
{
    json_error_t error;
    if (!metadata_is_object(info->metadata, info->metadata_size))
        return json_object();
    json_t *metadata = json_loadb(info->metadata, info->metadata_size, JSON_ALLOW_NUL, &error);
    enum json_error_code code = json_error_code(&error);
    if (!metadata && (code == json_error_numeric_overflow || code == json_error_null_byte_in_key))
        metadata = json_object(); // Jansson has none of the two
    return metadata;
}

const char *metadata_unit(const json_t *metadata, const char *field)
{
    const char *unit = json_string_value(json_object_get(json_object_get(metadata, "units"), field));
    return unit ? unit : "";
}
