/* SPDX-License-Identifier: BSD-3-Clause */
/* The types in which a stream stores values of cells. */
#ifndef TETLOD_CELL_TYPES_H
#define TETLOD_CELL_TYPES_H

#include "src/mesh/tetmesh.h"

/* The least type that holds a field of so many cells exactly. */
enum tetlod_cell_type cell_type_of(const struct point_field *field, size_t cells);

/* The least type that holds what both hold. */
enum tetlod_cell_type cell_type_of_both(enum tetlod_cell_type a, enum tetlod_cell_type b);

#endif
