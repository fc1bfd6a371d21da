/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of cells as rows, and as values of tetrahedra (SPEC 3.6). Not installed. */
#ifndef TETLOD_CELL_VALUES_H
#define TETLOD_CELL_VALUES_H

#include "format/read/reader.h"

/* The rows of a field: [components * tetlodi_cell_rows]. Errors as of tetlod_cells. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_cell_rows(const struct tetlod_file *file, uint32_t field, double *out,
                                                         struct tetlod_error *error);

/* The row of each tetrahedron, in an array that the caller frees; NULL: each has its own. ERR_STREAM, ERR_NOMEM, or as
 * tetlod_section_read. */
TETLOD_CHECKED enum tetlod_status tetlodi_read_parents(const struct tetlod_file *file, uint32_t **out,
                                                       struct tetlod_error *error);

/* Gives each tetrahedron its row, in place: `values` has room for all tetrahedra. */
void tetlodi_spread_rows(double *values, uint32_t components, const uint32_t *parents, uint32_t tets);

#endif
