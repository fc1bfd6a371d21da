/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/stream/metadata.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/utf8.h"
#include "src/util/json_text.h"

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
static uint32_t escaped(struct json_text *text)
{
    static const char letters[] = "bfnrt", meant[] = "\b\f\n\r\t";
    unsigned code, second;
    char letter = *text->at++;
    const char *place = strchr(letters, letter);
    if (letter != 'u')
        return (unsigned char)(place ? meant[place - letters] : letter);
    json_take_hex(text, &code);
    if (code < 0xd800 || code >= 0xe000)
        return code;
    text->at += 2;
    json_take_hex(text, &second);
    return 0x10000 + ((code - 0xd800) << 10) + (second - 0xdc00);
}

/* A string that was taken, from its first quote on, without its escapes; the caller frees it. */
static char *plain_string(const char *begin, const char *end, size_t *out_size)
{
    struct json_text text = {begin + 1, end - 1};
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

static json_t *string_value(struct json_text *text)
{
    const char *begin = text->at;
    size_t size;
    json_take_string(text);
    char *plain = plain_string(begin, text->at, &size);
    json_t *value = plain ? json_stringn_nocheck(plain, size) : NULL;
    free(plain);
    return value;
}

static json_t *number_value(struct json_text *text, bool *strange)
{
    const char *begin = text->at;
    json_take_number(text);
    bool whole = !memchr(begin, '.', (size_t)(text->at - begin)) && !memchr(begin, 'e', (size_t)(text->at - begin)) &&
                 !memchr(begin, 'E', (size_t)(text->at - begin));
    errno = 0;
    long long integer = whole ? strtoll(begin, NULL, 10) : 0; // a bracket or comma ends it
    if (whole && !errno)
        return json_integer(integer);
    double real = strtod(begin, NULL);
    *strange |= whole || !isfinite(real);
    return json_real(isfinite(real) ? real : 0);
}

static json_t *make_value(struct json_text *text, bool *strange);

static bool add_member(struct json_text *text, json_t *object, bool *strange)
{
    const char *begin = text->at;
    size_t size = 0;
    json_take_string(text);
    char *key = plain_string(begin, text->at, &size);
    *strange |= key && strlen(key) < size;
    json_skip_space(text);
    json_take(text, ':');
    json_t *value = key ? make_value(text, strange) : NULL;
    bool good = value && json_object_set_new_nocheck(object, key, value) == 0;
    free(key);
    return good;
}

/* After the bracket: members of an object, or elements of an array. */
static json_t *make_list(struct json_text *text, char close, bool *strange)
{
    json_t *list = close == '}' ? json_object() : json_array();
    bool good = list != NULL;
    json_skip_space(text);
    if (!good || json_take(text, close))
        return list;
    do {
        json_skip_space(text);
        good = close == '}' ? add_member(text, list, strange) : json_array_append_new(list,
                                                                                      make_value(text, strange)) == 0;
    } while (good && json_take(text, ','));
    if (good && json_take(text, close))
        return list;
    json_decref(list);
    return NULL;
}

/* Of a text that is known to be good. *strange: it has what Jansson has not, a number above DBL_MAX or a key with NUL.
 * NULL: memory is out. (Jansson's own reader can take a lack of memory for a wrong text, or end the program.) */
static json_t *make_value(struct json_text *text, bool *strange)
{
    json_t *value = NULL;
    json_skip_space(text);
    if (json_take(text, '{'))
        value = make_list(text, '}', strange);
    else if (json_take(text, '['))
        value = make_list(text, ']', strange);
    else if (*text->at == '"')
        value = string_value(text);
    else
        value = json_take_word(text, "true")    ? json_true()
                : json_take_word(text, "false") ? json_false()
                : json_take_word(text, "null")  ? json_null()
                                                : number_value(text, strange);
    json_skip_space(text);
    return value;
}

json_t *metadata_json(const struct tetlod_info *info)
{
    struct json_text text = {info->metadata, info->metadata + info->metadata_size};
    bool strange = false;
    if (!json_text_is_object(info->metadata, info->metadata_size))
        return json_object();
    json_t *metadata = make_value(&text, &strange);
    if (!metadata || !strange)
        return metadata;
    json_decref(metadata);
    return json_object();
}

bool metadata_own_ranges(const struct tetlod_info *info)
{
    json_t *metadata = metadata_json(info);
    const char *range = json_string_value(json_object_get(json_object_get(metadata, "options"), SERIES_RANGE));
    bool own = range && strcmp(range, "step") == 0;
    json_decref(metadata);
    return own;
}

bool metadata_is_part(const struct tetlod_info *info)
{
    json_t *metadata = metadata_json(info);
    bool part = json_is_string(json_object_get(metadata, "part_of"));
    json_decref(metadata);
    return part;
}

bool metadata_is_selection(const struct tetlod_info *info)
{
    json_t *metadata = metadata_json(info);
    const json_t *options = json_object_get(metadata, "options");
    bool selection = !json_is_object(options) || json_object_get(options, "carry");
    json_decref(metadata);
    return selection;
}

const char *metadata_unit(const json_t *metadata, const char *field)
{
    const char *unit = json_string_value(json_object_get(json_object_get(metadata, "units"), field));
    return unit && tetlodi_plain_text(unit, strlen(unit)) ? unit : "";
}

json_t *metadata_ids(const struct tetlod_info *info)
{
    if (!info->metadata || !strstr(info->metadata, "\"ids\"")) // most have none: they need not be parsed
        return NULL;
    json_t *object = metadata_json(info), *ids = json_incref(json_object_get(object, "ids"));
    json_decref(object);
    return ids;
}

bool metadata_is_id(const json_t *ids, const char *field)
{
    for (size_t i = 0; i < json_array_size(ids); i++) {
        const char *name = json_string_value(json_array_get(ids, i));
        if (name && strcmp(name, field) == 0)
            return true;
    }
    return false;
}
