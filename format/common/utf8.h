/* SPDX-License-Identifier: BSD-3-Clause */
/* What a name may hold: well-formed UTF-8 (RFC 3629) without controls and noncharacters (SPEC 3.3). */
#ifndef TETLOD_UTF8_H
#define TETLOD_UTF8_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Length of the well-formed character at `at`, of which `left` > 0 bytes are there, or 0. */
static inline size_t tetlodi_utf8_length(const uint8_t *at, size_t left, uint32_t *out_code)
{
    size_t length = at[0] < 0x80 ? 1 : at[0] >= 0xf0 ? 4 : at[0] >= 0xe0 ? 3 : 2;
    uint32_t code = length == 1 ? at[0] : at[0] & (0x7fu >> length), least[] = {0, 0, 0x80, 0x800, 0x10000};
    if ((length > 1 && at[0] < 0xc2) || at[0] > 0xf4 || length > left)
        return 0;
    for (size_t i = 1; i < length; i++) {
        if ((at[i] & 0xc0) != 0x80)
            return 0;
        code = code << 6 | (at[i] & 0x3f);
    }
    *out_code = code;
    return code < least[length] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000) ? 0 : length;
}

/* The same, but 0 for a character that no name may hold. */
static inline size_t tetlodi_character_length(const uint8_t *at, size_t left)
{
    uint32_t code = 0;
    size_t length = tetlodi_utf8_length(at, left, &code);
    return code < 0x20 || (code >= 0x7f && code < 0xa0) || code == 0xfffe || code == 0xffff ? 0 : length;
}

static inline bool tetlodi_plain_text(const char *text, size_t size)
{
    for (size_t i = 0, length; i < size; i += length)
        if ((length = tetlodi_character_length((const uint8_t *)text + i, size - i)) == 0)
            return false;
    return true;
}

#endif
