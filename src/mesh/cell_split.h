/* SPDX-License-Identifier: BSD-3-Clause */
/* Cells into tetrahedra so that neighbours match. */
#ifndef TETLOD_CELL_SPLIT_H
#define TETLOD_CELL_SPLIT_H

#include "format/tetlod.h"

/*
 * Corners as in VTK: hexahedron 0 1 2 3 the bottom counter-clockwise seen from above, 4 5 6 7 above them; pyramid 0 1 2
 * 3 the base, 4 the apex; prisms the bottom polygon, then the top one.
 */
enum cell_shape {
    CELL_TET,
    CELL_PYRAMID,
    CELL_WEDGE,
    CELL_HEXAHEDRON,
    CELL_PENTAGONAL_PRISM,
    CELL_HEXAGONAL_PRISM,
    CELL_SHAPES
};

enum { CELL_MAX_CORNERS = 12, CELL_MAX_TETS = 17 };

unsigned cell_corners(enum cell_shape shape);

/* The corners of a face, counter-clockwise seen from outside; NULL: there are not so many. */
const uint8_t *cell_face(enum cell_shape shape, unsigned face, unsigned *out_sides);

/* The tetrahedra of a cell other than a tetrahedron; returns their number. Every face is fanned from its vertex of
 * smallest id and the cell is the cone over them from its own smallest one, so two cells that share a face cut it the
 * same way. Where that inverts a tetrahedron, because the cell is bent, it is the cone from the corner that inverts
 * none, or whose least volume is the largest. Tetrahedra with a repeated corner (a collapsed cell) are left out. Turned
 * as a whole to positive volume. */
unsigned cell_split(enum cell_shape shape, const uint32_t *corners, const double *positions,
                    uint32_t tets[CELL_MAX_TETS][4]);

/* Six times the signed volume of a tetrahedron; and the same tetrahedron with the other sign. */
double cell_tet_volume6(const uint32_t tet[4], const double *positions);
void cell_tet_turn(uint32_t tet[4]);

/* Turns all tetrahedra if the sum of their volumes is negative. */
void cell_tets_turn(uint32_t (*tets)[4], size_t count, const double *positions);

/* A structured grid of dims points, i fastest: five tetrahedra a cell, mirrored from cell to cell so that faces match.
 * All are turned alike, to a positive sum of volumes. Of the two ways to begin it is the one that inverts fewer. */
uint64_t grid_tet_count(const uint32_t dims[3]);
void grid_split(const uint32_t dims[3], const double *positions, uint32_t *corners);

#endif
