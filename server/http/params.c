/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/params.h"

#include <string.h>

#include "format/common/utf8.h"

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    c = (char)(c | 0x20);
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static bool decode(const char *text, size_t size, char plus, char *out, size_t capacity)
{
    size_t used = 0;
    if (!capacity)
        return false;
    out[0] = 0;
    for (size_t i = 0; i < size; i++) {
        char c = text[i];
        if (c == '%') {
            int high = size - i > 2 ? hex_digit(text[i + 1]) : -1;
            int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
            if (low < 0)
                return false;
            c = (char)(high * 16 + low);
            i += 2;
        } else if (c == '+')
            c = plus;
        if (used + 1 >= capacity)
            return false;
        out[used++] = c;
    }
    out[used] = 0;
    return tetlodi_plain_text(out, used);
}

bool percent_decode(const char *text, size_t size, char *out, size_t capacity)
{
    return decode(text, size, '+', out, capacity);
}

bool percent_encode(const char *text, char *out, size_t capacity)
{
    static const char digits[] = "0123456789ABCDEF";
    size_t used = 0;
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || strchr("-._~", c);
        if (used + (plain ? 1 : 3) >= capacity)
            return false;
        if (plain)
            out[used++] = (char)c;
        else {
            out[used++] = '%';
            out[used++] = digits[c >> 4];
            out[used++] = digits[c & 15];
        }
    }
    if (used >= capacity)
        return false;
    out[used] = 0;
    return true;
}

/* The next name=value of a query; false at its end. Empty pieces (a&&b) are skipped. */
struct pair {
    const char *name, *value;
    size_t name_size, value_size;
};

static bool next_pair(const char **text, struct pair *out)
{
    while (*text && **text == '&')
        ++*text;
    if (!*text || !**text)
        return false;
    size_t size = strcspn(*text, "&"), name_size = strcspn(*text, "=&");
    *out = (struct pair){*text, *text + name_size, name_size, 0};
    if (name_size < size) {
        out->value++;
        out->value_size = size - name_size - 1;
    }
    *text += size;
    return true;
}

enum { NAME_CAPACITY = 64 };

static enum query_result find_value(const char *text, const char *name, char plus, char *out, size_t capacity)
{
    enum query_result result = QUERY_ABSENT;
    struct pair pair;
    char decoded[NAME_CAPACITY];
    while (next_pair(&text, &pair)) {
        if (!percent_decode(pair.name, pair.name_size, decoded, sizeof decoded) || strcmp(decoded, name) != 0)
            continue;
        if (result != QUERY_ABSENT || !decode(pair.value, pair.value_size, plus, out, capacity))
            return QUERY_BAD;
        result = QUERY_FOUND;
    }
    return result;
}

enum query_result query_value(const char *text, const char *name, char *out, size_t capacity)
{
    return find_value(text, name, '+', out, capacity);
}

enum query_result query_form_value(const char *text, const char *name, char *out, size_t capacity)
{
    return find_value(text, name, ' ', out, capacity);
}

bool query_begins_with(const char *text, const char *name)
{
    struct pair pair;
    char decoded[NAME_CAPACITY];
    return next_pair(&text, &pair) && percent_decode(pair.name, pair.name_size, decoded,
                                                     sizeof decoded) && strcmp(decoded, name) == 0;
}

size_t list_begins_with(const char *list, const char *name)
{
    size_t size = strlen(name);
    if (strncmp(list, name, size) != 0 || (list[size] && list[size] != ','))
        return 0;
    return size + (list[size] == ',');
}

size_t list_find(const char *list, const char *const *names, size_t stride, uint32_t count, uint32_t *out)
{
    size_t longest = 0;
    for (uint32_t i = 0; i < count; i++) {
        size_t length = list_begins_with(list, *(const char *const *)((const char *)names + i * stride));
        *out = length > longest ? i : *out;
        longest = length > longest ? length : longest;
    }
    return longest;
}

size_t list_find_either(char *list, const char *form, const char *const *names, size_t stride, uint32_t count,
                        uint32_t *out)
{
    size_t size = list_find(list, names, stride, count, out);
    if (!size && (size = list_find(form, names, stride, count, out)))
        memcpy(list, form, size);
    return size;
}

size_t next_name(const char **names, const char **out)
{
    *out = *names + strspn(*names, " ");
    *names = *out + strcspn(*out, " ");
    return strcspn(*out, " :");
}

static bool has_name(const char *names, const char *name)
{
    const char *one;
    size_t size;
    while ((size = next_name(&names, &one)))
        if (size == strlen(name) && memcmp(one, name, size) == 0)
            return true;
    return false;
}

bool query_unknown(const char *text, const char *names, char *out, size_t capacity)
{
    struct pair pair;
    char decoded[NAME_CAPACITY];
    while (next_pair(&text, &pair)) {
        bool readable = percent_decode(pair.name, pair.name_size, decoded, sizeof decoded);
        if (readable && has_name(names, decoded))
            continue;
        size_t size = readable ? strlen(decoded) : 0;
        if (size >= capacity)
            size = 0;
        memcpy(out, decoded, size);
        out[size] = 0;
        return true;
    }
    return false;
}
