/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/conditions.h"

#include <string.h>
#include <strings.h>

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

enum range_result request_range(const struct request *request, const char *etag, uint64_t size, uint64_t *first,
                                uint64_t *length)
{
    const char *if_range = request_header(request, "If-Range");
    if (request->method != METHOD_GET || (if_range && !etag_same(if_range, etag)))
        return RANGE_IGNORED;
    return range_parse(request_header(request, "Range"), size, first, length);
}

void apply_conditions(const struct request *request, struct response *response)
{
    uint64_t first, length;
    if (response->etag[0] && etag_list_has(request_header(request, "If-None-Match"), response->etag)) {
        response->status = 304; // the body stays: http.c needs its size
        return;
    }
    if (!response->ranges)
        return;
    response_header_text(response, "Accept-Ranges", "bytes");
    uint64_t size = response->size;
    switch (request_range(request, response->etag, size, &first, &length)) {
    case RANGE_IGNORED:
        return;
    case RANGE_UNSATISFIABLE:
        response_release(response);
        response_problem(response, 416, request->target, "the range lies outside the %llu bytes",
                         (unsigned long long)size);
        response_header(response, "Content-Range", "bytes */%llu", (unsigned long long)size);
        return;
    case RANGE_OK:
        response->status = 206;
        response_header(response, "Content-Range", "bytes %llu-%llu/%llu", (unsigned long long)first,
                        (unsigned long long)(first + length - 1), (unsigned long long)size);
        response->size = length;
        response->offset = first;
    }
}
