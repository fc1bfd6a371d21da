/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/web/wasm/print.h"

#include <stdbool.h>
#include <stdint.h>

struct text {
    char *bytes;
    size_t size, length;
};

static void put(struct text *text, char byte)
{
    if (text->length + 1 < text->size)
        text->bytes[text->length] = byte;
    text->length++;
}

static void put_number(struct text *text, uint64_t number, unsigned base, size_t width)
{
    char digits[20];
    size_t count = 0;
    do
        digits[count++] = "0123456789abcdef"[number % base];
    while (number /= base);
    for (size_t i = count; i < width; i++)
        put(text, '0');
    while (count)
        put(text, digits[--count]);
}

static size_t decimal(const char **at)
{
    size_t number = 0;
    while (**at >= '0' && **at <= '9')
        number = 10 * number + (size_t)(*(*at)++ - '0');
    return number;
}

int view_vsnprintf(char *bytes, size_t size, const char *format, va_list arguments)
{
    struct text text = {bytes, size, 0};
    for (; *format; format++) {
        if (*format != '%') {
            put(&text, *format);
            continue;
        }
        format++;
        size_t width = decimal(&format), most = SIZE_MAX;
        if (*format == '.') {
            format++;
            most = decimal(&format);
        }
        bool wide = (format[0] == 'l' && format[1] == 'l') || (sizeof(long) == 8 && *format == 'l') ||
                    (sizeof(size_t) == 8 && *format == 'z');
        while (*format == 'l' || *format == 'z' || *format == 'h')
            format++;
        if (*format == 's') {
            for (const char *from = va_arg(arguments, const char *); most-- && *from; from++)
                put(&text, *from);
        } else if (*format == '%') {
            put(&text, '%');
        } else {
            uint64_t number = wide ? va_arg(arguments, unsigned long long) : va_arg(arguments, unsigned);
            int64_t whole = wide ? (int64_t)number : (int)(unsigned)number;
            bool below = *format == 'd' && whole < 0;
            if (below)
                put(&text, '-');
            put_number(&text, below ? 0 - (uint64_t)whole : number, *format == 'x' ? 16 : 10, width);
        }
    }
    if (size)
        bytes[text.length < size ? text.length : size - 1] = 0;
    return (int)text.length;
}

int view_snprintf(char *text, size_t size, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    int length = view_vsnprintf(text, size, format, arguments);
    va_end(arguments);
    return length;
}
