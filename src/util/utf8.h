/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_UTF8_H
#define TETLOD_UTF8_H

/* Replaces, in place, every byte that is not part of well-formed UTF-8 and every control character by '_'. */
void utf8_clean(char *text);

#endif
