/* SPDX-License-Identifier: BSD-3-Clause */
/* A field's exact values from its codes, where all vertices' are not in a cursor. Not installed. */
#ifndef TETLOD_EXACT_VALUES_H
#define TETLOD_EXACT_VALUES_H

#include "format/tetlod.h"

/* Does the last level make the values of a field exact? */
int tetlodi_is_exact_later(const struct tetlod_file *file, uint32_t field);

/* The codes of a field that the cursor holds, [components * vertices], by the field's number. */
const int64_t *tetlodi_cursor_codes(const struct tetlod_cursor *cursor, uint32_t field);

/* The values that the last level gives such a field, from the codes of all vertices, in order. ERR_STREAM, or as
 * tetlod_section_read. */
TETLOD_CHECKED enum tetlod_status tetlodi_exact_values(const struct tetlod_file *file, uint32_t field,
                                                       const int64_t *codes, double *out, struct tetlod_error *error);

#endif
