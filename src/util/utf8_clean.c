/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/utf8_clean.h"

#include <string.h>

#include "format/common/utf8.h"

void utf8_clean(char *text)
{
    for (size_t left = strlen(text), length; left; text += length, left -= length) {
        length = tetlodi_character_length((const uint8_t *)text, left);
        if (length == 0) {
            *text = '_';
            length = 1;
        }
    }
}
