/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of the original's tetrahedra (SPEC 3.6): a table of them before level 0, and the values behind the last level.
 * Not installed. */
#ifndef TETLOD_CELLS_H
#define TETLOD_CELLS_H

#include "format/coding/index.h"

enum { CELL_REGION = 1, MAX_CELL_COMPONENTS = 64 };

#define MAX_WHOLE_CELL 0x1p53

/* Sets info.cell_fields to what the table says, and holds it against the sections of values. ERR_STREAM, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_cells_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                                       struct tetlod_error *error);

/* Section number `field` of those with values; NULL: there is none. */
const struct tetlodi_section *tetlodi_cells_section(const struct tetlodi_index *index, uint32_t field);

#endif
