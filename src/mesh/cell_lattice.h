/* SPDX-License-Identifier: BSD-3-Clause */
/* Lagrange cells: tetrahedra, hexahedra and wedges whose points are a lattice, into tetrahedra that use all of these
 * points. */
#ifndef TETLOD_CELL_LATTICE_H
#define TETLOD_CELL_LATTICE_H

#include <stdbool.h>

#include "src/mesh/cell_split.h"

enum { CELL_LATTICE_MAX_ORDER = 4, CELL_LATTICE_MAX_POINTS = 125, CELL_LATTICE_MAX_TETS = 64 * 9 };

/* The order along each axis of a cell that has the same order along all; false: no order up to the limit has so many
 * points. */
bool cell_lattice_orders(enum cell_shape shape, size_t points, unsigned orders[3]);

/* Whether a cell of these orders exists and has so many points. */
bool cell_lattice_fits(enum cell_shape shape, size_t points, const unsigned orders[3]);

/* How many tetrahedra a cell makes at most. */
unsigned cell_lattice_tets(enum cell_shape shape, const unsigned orders[3]);

/* `points` as in VTK: corners, then the points within edges, within faces, within the cell. The lattice is cut into
 * cells of first order, which are split by cell_split: two cells that share a face and its points cut it the same way.
 */
unsigned cell_lattice_split(enum cell_shape shape, const unsigned orders[3], const uint32_t *points,
                            const double *positions, uint32_t tets[CELL_LATTICE_MAX_TETS][4]);

#endif
