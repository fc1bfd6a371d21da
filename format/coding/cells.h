/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of the original's tetrahedra, or of the cells that were split into them (SPEC 3.6): a table of them before
 * level 0, and the values behind the last level. Not installed. */
#ifndef TETLOD_CELLS_H
#define TETLOD_CELLS_H

#include "format/coding/index.h"
#include "format/common/coder.h"

enum { CELL_REGION = 1, MAX_CELL_COMPONENTS = 64, PARENTS_SLOWEST = 7 };

#define MAX_WHOLE_CELL 0x1p53

/* Sets info.cell_fields to what the table CELL, or PCEL, says, and holds it against the sections of values. ERR_STREAM,
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_cells_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                                       struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status tetlodi_parents_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                                         struct tetlod_error *error);

/* Is a row of values that of a cell, not of a tetrahedron? */
static inline bool tetlodi_has_parents(const struct tetlodi_index *index)
{
    return index->parents != 0;
}

/* The rows that the values of cells have. */
static inline uint64_t tetlodi_cell_rows(const struct tetlodi_index *index)
{
    return tetlodi_has_parents(index) ? index->parents : index->info.tets;
}

/* May rows with so many bytes, their map's included, become so many numbers of tetrahedra (SPEC 2.3)? */
bool tetlodi_spread_holds(uint64_t numbers, uint64_t bytes);

/* The map, both ways: the row of each tetrahedron, rows numbered by first arrival. 0: a decoder has found what no
 * encoder writes. */
int tetlodi_parents_code(struct tetlodi_coder *coder, uint32_t *parents, uint32_t tets, uint32_t count);

/* Section number `field` of those with values; NULL: there is none. */
const struct tetlodi_section *tetlodi_cells_section(const struct tetlodi_index *index, uint32_t field);

#endif
