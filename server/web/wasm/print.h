/* SPDX-License-Identifier: BSD-3-Clause */
/* What the decoder needs of printf, in a tenth of its bytes: the page's compiler calls these in place of snprintf and
 * vsnprintf. They know %s, %d, %u, %x and %%, a width filled with zeros, a precision of %s, and the lengths h, l, ll
 * and z. They return what snprintf would. */
#ifndef TETLOD_VIEW_PRINT_H
#define TETLOD_VIEW_PRINT_H

#include <stdarg.h>
#include <stddef.h>

int view_vsnprintf(char *text, size_t size, const char *format, va_list arguments);
int view_snprintf(char *text, size_t size, const char *format, ...);

#endif
