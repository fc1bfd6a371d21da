/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/utf8.h"

#include <stddef.h>
#include <stdint.h>

/* Length of the well-formed character at `at` (RFC 3629), or 0. */
static size_t character_length(const unsigned char *at)
{
    if (at[0] < 0x80)
        return at[0] >= 0x20 && at[0] != 0x7f;
    size_t length = at[0] >= 0xf0 ? 4 : at[0] >= 0xe0 ? 3 : 2;
    uint32_t code = at[0] & (0x7fu >> length), least[] = {0, 0, 0x80, 0x800, 0x10000};
    if (at[0] < 0xc2 || at[0] > 0xf4)
        return 0;
    for (size_t i = 1; i < length; i++) {
        if ((at[i] & 0xc0) != 0x80)
            return 0;
        code = code << 6 | (at[i] & 0x3f);
    }
    if (code < least[length] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000))
        return 0;
    return code < 0xa0 || code == 0xfffe || code == 0xffff ? 0 : length; // C1 controls; what XML cannot hold
}

void utf8_clean(char *text)
{
    for (unsigned char *at = (unsigned char *)text; *at;) {
        size_t length = character_length(at);
        if (length == 0)
            *at = '_';
        at += length ? length : 1;
    }
}
