/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/params.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/utf8.h"

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
    return next_pair(&text, &pair) && percent_decode(pair.name, pair.name_size, decoded, sizeof decoded) && strcmp(decoded, name) == 0;
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

size_t list_find_either(char *list, const char *form, const char *const *names, size_t stride, uint32_t count, uint32_t *out)
{
    size_t size = list_find(list, names, stride, count, out);
    if (!size && (size = list_find(form, names, stride, count, out)))
        memcpy(list, form, size);
    return size;
}

bool query_unknown(const char *text, const char *const *names, char *out, size_t capacity)
{
    struct pair pair;
    char decoded[NAME_CAPACITY];
    while (next_pair(&text, &pair)) {
        bool known = false;
        bool readable = percent_decode(pair.name, pair.name_size, decoded, sizeof decoded);
        for (size_t i = 0; readable && names[i] && !known; i++)
            known = strcmp(decoded, names[i]) == 0;
        if (known)
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

bool text_number(const char *text, bool percent, double *out)
{
    char *end;
    size_t size = strspn(text, "+-.0123456789eE");
    if (!size || size > 64 || (text[size] && strcmp(text + size, "%") != 0)) // strtod also knows nan, inf and 0x
        return false;
    double value = strtod(text, &end);
    double scale = percent && strcmp(end, "%") == 0 ? 0.01 : 1;
    if (end == text || (*end && scale == 1) || !isfinite(value))
        return false;
    *out = value * scale;
    return true;
}

bool text_count(const char *text, bool suffix, uint64_t *out)
{
    uint64_t value = 0;
    const char *at = text;
    for (; *at >= '0' && *at <= '9'; at++) {
        uint64_t digit = (uint64_t)(*at - '0');
        if (value > (UINT64_MAX - digit) / 10)
            return false;
        value = value * 10 + digit;
    }
    if (at == text)
        return false;
    if (suffix && *at) {
        const char *power = strchr("KMGT", *at);
        unsigned shift = power ? 10 * (unsigned)(power - "KMGT" + 1) : 0;
        if (!power || value > UINT64_MAX >> shift)
            return false;
        value <<= shift;
        at++;
    }
    *out = value;
    return !*at;
}

bool text_numbers(const char *text, size_t count, double *out)
{
    char one[80];
    for (size_t i = 0; i < count; i++) {
        size_t size = strcspn(text, ",");
        if (size >= sizeof one)
            return false;
        memcpy(one, text, size);
        one[size] = 0;
        text += size;
        if (!text_number(one, false, &out[i]) || (*text == ',') != (i + 1 < count))
            return false;
        text += *text == ',';
    }
    return true;
}

size_t print_number(char *out, size_t capacity, double value)
{
    int digits = 0;
    do
        snprintf(out, capacity, "%.*g", ++digits, value);
    while (digits < 17 && strtod(out, NULL) != value);
    char *plus = strchr(out, '+');
    if (plus)
        memmove(plus, plus + 1, strlen(plus));
    return strlen(out);
}

static bool digits(const char **at, uint64_t *out)
{
    const char *start = *at;
    uint64_t value = 0;
    for (; **at >= '0' && **at <= '9'; ++*at) {
        uint64_t digit = (uint64_t)(**at - '0');
        value = value > (UINT64_MAX - digit) / 10 ? UINT64_MAX : value * 10 + digit; // far beyond any size either way
    }
    *out = value;
    return *at != start;
}

enum range_result range_parse(const char *header, uint64_t size, uint64_t *out_first, uint64_t *out_length)
{
    if (!header || strncasecmp(header, "bytes=", 6) != 0)
        return RANGE_IGNORED;
    const char *at = header + 6 + strspn(header + 6, " \t");
    uint64_t first = 0, last = UINT64_MAX;
    bool has_first = digits(&at, &first);
    if (*at++ != '-')
        return RANGE_IGNORED;
    bool has_last = digits(&at, &last);
    at += strspn(at, " \t");
    if (*at || (!has_first && !has_last) || (has_first && has_last && last < first))
        return RANGE_IGNORED;
    if (!has_first) {
        if (!last || !size)
            return RANGE_UNSATISFIABLE;
        *out_length = last < size ? last : size;
        *out_first = size - *out_length;
        return RANGE_OK;
    }
    if (first >= size)
        return RANGE_UNSATISFIABLE;
    if (!has_last || last >= size)
        last = size - 1;
    *out_first = first;
    *out_length = last - first + 1;
    return RANGE_OK;
}

bool etag_list_has(const char *list, const char *etag)
{
    const char *at = list ? list : "";
    if (strncmp(etag, "W/", 2) == 0)
        etag += 2;
    at += strspn(at, " \t");
    if (at[0] == '*' && at[1 + strspn(at + 1, " \t")] == 0)
        return true;
    while (*at) {
        at += strspn(at, " \t,");
        if (strncmp(at, "W/", 2) == 0)
            at += 2;
        if (*at != '"')
            return false;
        size_t size = strcspn(at + 1, "\"") + 2;
        if (!at[size - 1])
            return false;
        if (size == strlen(etag) && memcmp(at, etag, size) == 0)
            return true;
        at += size;
    }
    return false;
}

bool etag_same(const char *header, const char *etag)
{
    return header[0] == '"' && strcmp(header, etag) == 0;
}

const char *coding_name(enum coding coding)
{
    static const char *const names[CODINGS] = {"", "gzip", "zstd", "br"};
    return names[coding];
}

/* q of RFC 9110, 12.4.2, in thousandths; 0 for anything that is not one. */
static int quality(const char *parameters, size_t size)
{
    const char *end = parameters + size, *at = parameters;
    while (at < end && (*at == ' ' || *at == '\t'))
        at++;
    if (at == end)
        return 1000;
    if (*at++ != ';')
        return 0;
    while (at < end && (*at == ' ' || *at == '\t'))
        at++;
    if (end - at < 3 || (at[0] | 0x20) != 'q' || at[1] != '=' || (at[2] != '0' && at[2] != '1'))
        return 0;
    int value = (at[2] - '0') * 1000, unit = 100;
    at += 3;
    if (at < end && *at == '.')
        for (at++; at < end && *at >= '0' && *at <= '9' && unit; at++, unit /= 10)
            value += (*at - '0') * unit;
    while (at < end && (*at == ' ' || *at == '\t'))
        at++;
    return at == end && value <= 1000 ? value : 0;
}

static bool same_word(const char *text, size_t size, const char *word)
{
    return size == strlen(word) && strncasecmp(text, word, size) == 0;
}

enum coding coding_choose(const char *accept_encoding, unsigned have)
{
    int q[CODINGS] = {-1, -1, -1, -1}, star = -1;
    const char *at = accept_encoding ? accept_encoding : "";
    while (*at) {
        at += strspn(at, " \t,");
        size_t size = strcspn(at, ","), word = strcspn(at, ";, \t");
        int value = quality(at + word, size - word);
        if (same_word(at, word, "gzip") || same_word(at, word, "x-gzip"))
            q[CODING_GZIP] = value;
        else if (same_word(at, word, "zstd"))
            q[CODING_ZSTD] = value;
        else if (same_word(at, word, "br"))
            q[CODING_BROTLI] = value;
        else if (same_word(at, word, "identity"))
            q[CODING_IDENTITY] = value;
        else if (same_word(at, word, "*"))
            star = value;
        at += size;
    }
    for (int c = CODING_GZIP; c < CODINGS; c++)
        q[c] = q[c] < 0 ? (star > 0 ? star : 0) : q[c];
    if (q[CODING_IDENTITY] < 0)
        q[CODING_IDENTITY] = star >= 0 ? star : 1; // acceptable unless refused, but only just
    enum coding best = CODING_IDENTITY;
    for (int c = CODING_GZIP; c < CODINGS; c++)
        if ((have & 1u << c) && q[c] && q[c] >= q[best])
            best = (enum coding)c;
    return best;
}
