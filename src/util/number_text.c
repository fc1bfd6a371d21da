/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/number_text.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_NUMBER_TEXT = 64 };

bool text_take_number(const char **at, double *out)
{
    char *end;
    size_t sign = strspn(*at, "+-");
    if (sign > 1 || !strchr(".0123456789", (*at)[sign]) || !(*at)[sign] ||
        tolower((unsigned char)(*at)[sign + 1]) == 'x')
        return false; // strtod also knows blanks, nan, inf and 0x
    double value = strtod(*at, &end);
    if (end == *at || !isfinite(value))
        return false;
    *at = end;
    *out = value;
    return true;
}

bool text_number(const char *text, bool percent, double *out)
{
    double value;
    if (strspn(text, "+-.0123456789eE") > MAX_NUMBER_TEXT || !text_take_number(&text, &value))
        return false;
    bool scaled = percent && strcmp(text, "%") == 0;
    if (*text && !scaled)
        return false;
    *out = value * (scaled ? 0.01 : 1);
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
