/* SPDX-License-Identifier: BSD-3-Clause */
/* The values of cells at the steps of an open series (SPEC 3.7). Not installed. */
#ifndef TETLOD_SERIES_CELLS_H
#define TETLOD_SERIES_CELLS_H

#include "format/coding/cell_steps.h"
#include "format/read/reader.h"

/* In messages. */
#define GROUP_OF_STEPS "a group of steps"

/* The group that a field was decoded in last. */
struct tetlodi_cell_track {
    struct tetlodi_steps steps;
    uint8_t *bytes; /* of the group's frames; owned */
    uint64_t at;
    uint32_t group, next; /* TETLOD_NONE: none; the step that would be decoded next */
};

struct tetlodi_series_cells {
    const struct tetlod_file *file;
    struct tetlodi_cell_time time;            /* without fields where none has steps */
    const struct tetlodi_section **sections;  /* [field] */
    struct tetlodi_cell_track *tracks;        /* [field] */
    uint32_t *parents; /* of each tetrahedron its row; NULL: not read yet, or each has its own */
};

/* Reads the table, if there is one, and holds it against the stream. To be freed also after a failure. */
TETLOD_CHECKED enum tetlod_status tetlodi_series_cells_open(struct tetlodi_series_cells *cells,
                                                            const struct tetlod_file *file, uint32_t step_count,
                                                            struct tetlod_error *error);
void tetlodi_series_cells_fini(struct tetlodi_series_cells *cells);

/* The row of the table that a cell field of the stream has, or TETLOD_NONE. */
uint32_t tetlodi_series_cells_find(const struct tetlodi_series_cells *cells, uint32_t field);

/* The bytes of the stream that a step needs of the field of a row, beside the values of the first step: those of its
 * group up to it. */
struct tetlod_span tetlodi_series_cells_span(const struct tetlodi_series_cells *cells, uint32_t row, uint32_t group);

/* The values of the row's field at a step: [components * tetrahedra]. ERR_STREAM, ERR_CHECKSUM, ERR_TRUNCATED,
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_series_cells_decode(struct tetlodi_series_cells *cells, uint32_t row,
                                                              uint32_t step, double *out, struct tetlod_error *error);

/* The groups of all sections CSTP; NULL counts them. */
size_t tetlodi_series_cells_parts(const struct tetlodi_series_cells *cells, struct tetlodi_frame *out);

#endif
