/* SPDX-License-Identifier: BSD-3-Clause */
/* tetlod verify: does the index say what the stream holds? */
#ifndef TETLOD_VERIFY_INDEX_H
#define TETLOD_VERIFY_INDEX_H

#include "src/mesh/tetmesh.h"

/* Holds bounds, ranges of fields and counts of degenerate and inverted tetrahedra against the finest level, and ranges
 * of values of cells against these, which are decoded; of a lossless stream also the sums of section SUMS. Figures of a
 * part of a stream are those of the whole one: of it only the values of cells are read. ERR_STREAM, ERR_NOMEM, or as
 * tetlod_cells. */
TETLOD_CHECKED enum tetlod_status verify_index(const struct tetlod_file *file, const struct tetmesh *finest,
                                               struct tetlod_error *error);

/* Decodes the values of cells at every step of a series: they have the range that their table says. ERR_STREAM,
 * ERR_CHECKSUM, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status verify_cell_steps(const struct tetlod_file *file, struct tetlod_error *error);

#endif
