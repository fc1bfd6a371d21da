/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of the original's tetrahedra (SPEC 3.6): a table of them before level 0, and the values behind the last level.
 * Not installed. */
#ifndef TETLOD_CELLS_H
#define TETLOD_CELLS_H

#include "format/index.h"
#include "format/writer.h"

#define TAG_CELLS "CELL"
#define TAG_CELL_VALUES "CVAL"

enum { CELL_REGION = 1, MAX_CELL_COMPONENTS = 64 };

#define MAX_WHOLE_CELL 0x1p53

/* Bytes of one value. */
unsigned tetlodi_cell_width(enum tetlod_cell_type type);

/* Sets info.cell_fields to what the table says, and holds it against the sections of values. ERR_STREAM, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_cells_decode(struct tetlodi_index *index, const uint8_t *bytes, size_t size,
                                                       struct tetlod_error *error);

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
