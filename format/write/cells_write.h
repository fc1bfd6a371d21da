/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of the original's tetrahedra as sections (SPEC 3.6). Not installed. */
#ifndef TETLOD_CELLS_WRITE_H
#define TETLOD_CELLS_WRITE_H

#include "format/common/bytes.h"
#include "format/write/write_input.h"

/* NULL, or why these fields cannot be written. */
const char *tetlodi_cells_wrong(const struct tetlodi_write_cells *cells, uint32_t count, uint32_t tets);

/* The table, and the rows of each field. */
struct tetlodi_cell_parts {
    uint32_t count;
    struct tetlodi_buffer table, *rows; /* [count] */
};

/* In the stream's order, of which original_of gives the caller's numbers. False: out of memory. */
bool tetlodi_cells_encode(struct tetlodi_cell_parts *out, const struct tetlodi_write_cells *cells, uint32_t count,
                          const uint32_t *original_of, uint32_t tets);

/* Their sections; returns how many there are, 1 + count at most. */
uint32_t tetlodi_cells_list(const struct tetlodi_cell_parts *parts, const struct tetlodi_write_cells *cells,
                            struct tetlodi_write_section *sections);
void tetlodi_cell_parts_fini(struct tetlodi_cell_parts *parts);

#endif
