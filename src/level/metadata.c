/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/level/metadata.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "format/utf8.h"

enum { MOST_DEPTH = 1024 }; /* of objects and arrays in each other: the stack is finite */

/* What is read, and whether values are made of it: if not, json_true stands for each. Jansson's own reader can take a lack of memory for a
 * wrong text, or end the program. */
struct text {
    const char *at, *end;
    bool makes;
    bool strange; /* what Jansson has not: a number above DBL_MAX, a key with NUL */
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

/* ---- values; NULL: the text is not one, or memory is out */

static char *put_character(char *out, uint32_t code)
{
    static const unsigned char first[5] = {0, 0, 0xc0, 0xe0, 0xf0};
    int length = code < 0x80 ? 1 : code < 0x800 ? 2 : code < 0x10000 ? 3 : 4;
    for (int i = length - 1; i > 0; i--, code >>= 6)
        out[i] = (char)(0x80 | (code & 0x3f));
    out[0] = (char)(first[length] | code);
    return out + length;
}

/* The character that an escape stands for, which is a good one. */
static uint32_t escaped(struct text *text)
{
    static const char letters[] = "bfnrt", meant[] = "\b\f\n\r\t";
    unsigned code, second;
    char letter = *text->at++;
    const char *place = strchr(letters, letter);
    if (letter != 'u')
        return (unsigned char)(place ? meant[place - letters] : letter);
    take_hex(text, &code);
    if (code < 0xd800 || code >= 0xe000)
        return code;
    text->at += 2;
    take_hex(text, &second);
    return 0x10000 + ((code - 0xd800) << 10) + (second - 0xdc00);
}

/* A string that was taken, from its first quote on, without its escapes; the caller frees it. */
static char *plain_string(const char *begin, const char *end, size_t *out_size)
{
    struct text text = {.at = begin + 1, .end = end - 1};
    char *plain = malloc((size_t)(end - begin)), *out = plain;
    while (plain && text.at < text.end)
        if (*text.at != '\\')
            *out++ = *text.at++;
        else {
            text.at++;
            out = put_character(out, escaped(&text));
        }
    if (plain)
        *out = 0;
    *out_size = plain ? (size_t)(out - plain) : 0;
    return plain;
}

static json_t *string_value(struct text *text)
{
    const char *begin = text->at;
    size_t size;
    if (!take_string(text))
        return NULL;
    if (!text->makes)
        return json_true();
    char *plain = plain_string(begin, text->at, &size);
    json_t *value = plain ? json_stringn_nocheck(plain, size) : NULL;
    free(plain);
    return value;
}

static json_t *number_value(struct text *text)
{
    const char *begin = text->at;
    if (!take_number(text))
        return NULL;
    if (!text->makes)
        return json_true();
    bool whole = !memchr(begin, '.', (size_t)(text->at - begin)) && !memchr(begin, 'e', (size_t)(text->at - begin)) &&
                 !memchr(begin, 'E', (size_t)(text->at - begin));
    errno = 0;
    long long integer = whole ? strtoll(begin, NULL, 10) : 0; // a bracket or comma ends it
    if (whole && !errno)
        return json_integer(integer);
    double real = strtod(begin, NULL);
    text->strange |= whole || !isfinite(real);
    return json_real(isfinite(real) ? real : 0);
}

static json_t *take_value(struct text *text, int depth);

static bool take_member(struct text *text, json_t *object, int depth)
{
    const char *begin = text->at;
    size_t size = 0;
    if (!take_string(text))
        return false;
    char *key = text->makes ? plain_string(begin, text->at, &size) : NULL;
    text->strange |= key && strlen(key) < size;
    skip_space(text);
    json_t *value = (key || !text->makes) && take(text, ':') ? take_value(text, depth) : NULL;
    bool good = value && (!text->makes || json_object_set_new_nocheck(object, key, value) == 0);
    free(key);
    return good;
}

static bool take_element(struct text *text, json_t *array, int depth)
{
    json_t *value = take_value(text, depth);
    return value && (!text->makes || json_array_append_new(array, value) == 0);
}

/* After the bracket: members of an object, or elements of an array. */
static json_t *take_list(struct text *text, char close, int depth)
{
    json_t *list = !text->makes ? json_true() : close == '}' ? json_object() : json_array();
    bool good = list != NULL, more;
    skip_space(text);
    if (good && take(text, close))
        return list;
    do {
        skip_space(text);
        good = good && (close == '}' ? take_member(text, list, depth) : take_element(text, list, depth));
        more = good && take(text, ',');
    } while (more);
    if (good && take(text, close))
        return list;
    json_decref(list);
    return NULL;
}

static json_t *take_value(struct text *text, int depth)
{
    json_t *value = NULL;
    skip_space(text);
    if (take(text, '{'))
        value = depth > 0 ? take_list(text, '}', depth - 1) : NULL;
    else if (take(text, '['))
        value = depth > 0 ? take_list(text, ']', depth - 1) : NULL;
    else if (text->at < text->end && *text->at == '"')
        value = string_value(text);
    else
        value = take_word(text, "true")    ? json_true()
                : take_word(text, "false") ? json_false()
                : take_word(text, "null")  ? json_null()
                                           : number_value(text);
    skip_space(text);
    return value;
}

bool metadata_is_object(const char *text, size_t size)
{
    struct text rest = {.at = text, .end = text + size};
    skip_space(&rest);
    return rest.at < rest.end && *rest.at == '{' && take_value(&rest, MOST_DEPTH) && rest.at == rest.end;
}

json_t *metadata_json(const struct tetlod_info *info)
{
    struct text text = {.at = info->metadata, .end = info->metadata + info->metadata_size, .makes = true};
    if (!metadata_is_object(info->metadata, info->metadata_size))
        return json_object();
    json_t *metadata = take_value(&text, MOST_DEPTH);
    if (!metadata || !text.strange)
        return metadata;
    json_decref(metadata);
    return json_object();
}

bool metadata_is_part(const struct tetlod_info *info)
{
    json_t *metadata = metadata_json(info);
    bool part = json_is_string(json_object_get(metadata, "part_of"));
    json_decref(metadata);
    return part;
}

const char *metadata_unit(const json_t *metadata, const char *field)
{
    const char *unit = json_string_value(json_object_get(json_object_get(metadata, "units"), field));
    return unit && tetlodi_plain_text(unit, strlen(unit)) ? unit : "";
}
