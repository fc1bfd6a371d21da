/* SPDX-License-Identifier: BSD-3-Clause */
/* Fields at points from values of tetrahedra. */
#ifndef TETLOD_CELL_AVERAGE_H
#define TETLOD_CELL_AVERAGE_H

#include "src/mesh/tetmesh.h"

/* Adds a point field for the cell field: at each point the mean over its tetrahedra, weighted by volume; tetrahedra
 * whose value is NaN do not count. The name gets a number if a point field has it. */
TETLOD_CHECKED enum tetlod_status cell_average(struct tetmesh *mesh, uint32_t cell_field, struct tetlod_error *error);

#endif
