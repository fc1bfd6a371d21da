/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of the original's tetrahedra as sections (SPEC 3.6). Not installed. */
#ifndef TETLOD_CELLS_WRITE_H
#define TETLOD_CELLS_WRITE_H

#include "format/common/bytes.h"
#include "format/write/write_input.h"

/* NULL, or why these fields cannot be written. */
const char *tetlodi_cells_wrong(const struct tetlodi_write_cells *cells, uint32_t count, uint32_t tets);

/* What is encoded: in the stream's order, of which original_of gives the caller's numbers. */
struct tetlodi_cells_input {
    const struct tetlodi_write_cells *cells;
    uint32_t count, tets;
    const uint32_t *original_of; /* [tets] */
    const uint32_t *parents;     /* by the caller's numbers: alike where tetrahedra are of one cell; or NULL */
};

/* The table, the map if rows are those of cells, and the rows of each field. */
struct tetlodi_cell_parts {
    uint32_t count, row_count;
    uint32_t *tet_of; /* [row_count] the caller's number of the first tetrahedron of each row */
    bool has_parents, in_parents; /* rows are those of cells; PCEL is the table, in place of CELL */
    struct tetlodi_buffer table, map, *rows; /* [count] */
};

/* Rows are those of cells where the stream becomes smaller by that. False: out of memory. */
bool tetlodi_cells_encode(struct tetlodi_cell_parts *out, const struct tetlodi_cells_input *in);

/* Their sections; returns how many there are, 2 + count at most. */
uint32_t tetlodi_cells_list(const struct tetlodi_cell_parts *parts, const struct tetlodi_write_cells *cells,
                            struct tetlodi_write_section *sections);
void tetlodi_cell_parts_fini(struct tetlodi_cell_parts *parts);

#endif
