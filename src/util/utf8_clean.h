/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_UTIL_UTF8_CLEAN_H
#define TETLOD_UTIL_UTF8_CLEAN_H

/* Replaces, in place, every byte that is not part of what a name may hold (format/common/utf8.h) by '_'. */
void utf8_clean(char *text);

#endif
