/* SPDX-License-Identifier: BSD-3-Clause */
/* Cells of any kind, in VTK's terms. */
#ifndef TETLOD_MIXED_CELLS_H
#define TETLOD_MIXED_CELLS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Cell c is of VTK type types[c] and has the corners connectivity[offsets[c] .. offsets[c+1]). A polyhedron (42) has
 * instead: its number of faces, and for each the number of its points and these. */
struct cells {
    uint64_t count, connectivity_count;
    unsigned char *types;   /* owned; NULL: tetrahedra throughout, and no offsets */
    uint64_t *offsets;      /* owned, count + 1 */
    uint32_t *connectivity; /* owned; TETLOD_NONE: the file's number is not one of a point */
    size_t type_capacity, offset_capacity, connectivity_capacity;
};

/* VTK's types of cells that formats have, and one that stands for all that have no volume. */
enum {
    VTK_TYPE_FLAT = 5,
    VTK_TYPE_TET = 10,
    VTK_TYPE_VOXEL = 11,
    VTK_TYPE_HEXAHEDRON = 12,
    VTK_TYPE_WEDGE = 13,
    VTK_TYPE_PYRAMID = 14,
    VTK_TYPE_TET10 = 24,
    VTK_TYPE_HEXAHEDRON20 = 25,
    VTK_TYPE_WEDGE15 = 26,
    VTK_TYPE_PYRAMID13 = 27,
    VTK_TYPE_HEXAHEDRON27 = 29,
    VTK_TYPE_WEDGE18 = 32,
    VTK_TYPE_POLYHEDRON = 42,
    VTK_TYPE_LAGRANGE_HEXAHEDRON = 72
};

void cells_fini(struct cells *cells);

/* Numbers of points among the connectivity of a cell, of types or without: calls `visit` with each. False: the faces of
 * a polyhedron do not fit its entries. */
bool cells_visit_points(const struct cells *cells, uint64_t cell, void (*visit)(void *opaque, uint32_t *point),
                        void *opaque);

#endif
