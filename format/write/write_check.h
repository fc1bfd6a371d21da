/* SPDX-License-Identifier: BSD-3-Clause */
/* What an encoder refuses to write. Not installed. */
#ifndef TETLOD_WRITE_CHECK_H
#define TETLOD_WRITE_CHECK_H

#include "format/write/write_input.h"

/* Sections that a writer makes beside one for each field of cells, at most: metadata, the order, table and map of
 * cells, pages. */
enum { MAX_OWN_SECTIONS = 5 };

/* Is the last level the exact tail? */
int tetlodi_has_tail(const struct tetlodi_write_input *in);

/* Why the sequence cannot be written, or NULL. */
const char *tetlodi_input_wrong(const struct tetlodi_write_input *in);

#endif
