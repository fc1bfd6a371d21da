/* SPDX-License-Identifier: BSD-3-Clause */
/* Cells that two pieces of a mesh have. */
#ifndef TETLOD_CELLS_TWICE_H
#define TETLOD_CELLS_TWICE_H

#include "src/io/services/assemble.h"

/* Where the cells of each block end among those of all: [count], to be freed; NULL: out of memory. */
uint64_t *blocks_cell_ends(const struct blocks *blocks);

/* `block` is what `pieces` blocks have become, whose cells end there. ERR_MESH: two of them have a cell of the same
 * points, which neither marks as a ghost; ERR_NOMEM. Takes a look at each cell, and sorts those of which all points are
 * of several pieces. */
TETLOD_CHECKED enum tetlod_status cells_check_twice(const struct block *block, const uint64_t *ends, size_t pieces,
                                                    struct tetlod_error *error);

#endif
