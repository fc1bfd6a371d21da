/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/json_text.h"

#include <stdint.h>
#include <string.h>

#include "format/common/utf8.h"

enum { MAX_DEPTH = 1024 }; /* of objects and arrays in each other: the stack is finite */

bool json_take(struct json_text *text, char wanted)
{
    bool there = text->at < text->end && *text->at == wanted;
    text->at += there;
    return there;
}

bool json_take_word(struct json_text *text, const char *word)
{
    size_t length = strlen(word);
    bool there = (size_t)(text->end - text->at) >= length && memcmp(text->at, word, length) == 0;
    text->at += there ? length : 0;
    return there;
}

void json_skip_space(struct json_text *text)
{
    while (text->at < text->end && memchr(" \t\n\r", *text->at, 4))
        text->at++;
}

static size_t take_digits(struct json_text *text)
{
    const char *begin = text->at;
    while (text->at < text->end && *text->at >= '0' && *text->at <= '9')
        text->at++;
    return (size_t)(text->at - begin);
}

bool json_take_number(struct json_text *text)
{
    json_take(text, '-');
    if (!json_take(text, '0') && !take_digits(text))
        return false;
    if (json_take(text, '.') && !take_digits(text))
        return false;
    if (!json_take(text, 'e') && !json_take(text, 'E'))
        return true;
    if (!json_take(text, '+'))
        json_take(text, '-');
    return take_digits(text);
}

bool json_take_hex(struct json_text *text, unsigned *out)
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
static bool take_escape(struct json_text *text)
{
    unsigned code, second;
    if (!json_take(text, 'u'))
        return text->at < text->end && memchr("\"\\/bfnrt", *text->at++, 8);
    if (!json_take_hex(text, &code) || (code >= 0xdc00 && code < 0xe000))
        return false;
    return code < 0xd800 || code >= 0xe000 ||
           (json_take_word(text, "\\u") && json_take_hex(text, &second) && second >= 0xdc00 && second < 0xe000);
}

/* Well-formed UTF-8 with any character from U+0020 on. */
static bool take_character(struct json_text *text)
{
    uint32_t code;
    size_t length = tetlodi_utf8_length((const uint8_t *)text->at, (size_t)(text->end - text->at), &code);
    text->at += length;
    return length && code >= 0x20;
}

bool json_take_string(struct json_text *text)
{
    if (!json_take(text, '"'))
        return false;
    while (text->at < text->end && *text->at != '"')
        if (json_take(text, '\\') ? !take_escape(text) : !take_character(text))
            return false;
    return json_take(text, '"');
}

static bool take_value(struct json_text *text, int depth);

/* After the bracket: members of an object, or elements of an array. */
static bool take_list(struct json_text *text, char close, int depth)
{
    json_skip_space(text);
    if (json_take(text, close))
        return true;
    do {
        json_skip_space(text);
        if (close == '}') {
            if (!json_take_string(text))
                return false;
            json_skip_space(text);
            if (!json_take(text, ':'))
                return false;
        }
        if (!take_value(text, depth))
            return false;
    } while (json_take(text, ','));
    return json_take(text, close);
}

static bool take_value(struct json_text *text, int depth)
{
    bool good;
    json_skip_space(text);
    if (json_take(text, '{'))
        good = depth > 0 && take_list(text, '}', depth - 1);
    else if (json_take(text, '['))
        good = depth > 0 && take_list(text, ']', depth - 1);
    else if (text->at < text->end && *text->at == '"')
        good = json_take_string(text);
    else
        good = json_take_word(text, "true") || json_take_word(text, "false") || json_take_word(text, "null") ||
               json_take_number(text);
    json_skip_space(text);
    return good;
}

bool json_text_is_object(const char *text, size_t size)
{
    struct json_text rest = {text, text + size};
    json_skip_space(&rest);
    return rest.at < rest.end && *rest.at == '{' && take_value(&rest, MAX_DEPTH) && rest.at == rest.end;
}
