/* SPDX-License-Identifier: BSD-3-Clause */
/* Cells of the second order into tetrahedra that use the points in the middle of their edges. */
#ifndef TETLOD_CELL_REFINE_H
#define TETLOD_CELL_REFINE_H

#include "src/mesh/cell_split.h"

enum { CELL_REFINED_MOST_TETS = 6 * 6 };

/* `points`: the corners and then the middles of the edges, as in VTK. Tetrahedra, hexahedra, wedges and pyramids. A
 * face is cut into triangles about its corners and what is left between the middles, alike by both its cells; a
 * tetrahedron makes eight, other cells a cone over these triangles from the point `centre`. Turned as a whole to
 * positive volume. */
unsigned cell_refine(enum cell_shape shape, const uint32_t *points, uint32_t centre, const double *positions,
                     uint32_t tets[CELL_REFINED_MOST_TETS][4]);

#endif
