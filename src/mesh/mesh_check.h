/* SPDX-License-Identifier: BSD-3-Clause */
/* What a tetrahedral mesh is like: counts, geometry, and whether it is a manifold. Pure functions of the arrays. */
#ifndef TETLOD_MESH_CHECK_H
#define TETLOD_MESH_CHECK_H

#include "format/tetlod.h"

struct mesh_report {
    uint32_t vertices, tets;
    uint32_t unused_vertices;  /* of no tetrahedron */
    uint32_t components;       /* parts that share no vertex */

    int orientation;           /* of the majority by volume: +1, -1, or 0 if the volumes cancel out */
    uint32_t degenerate_tets;  /* by TET_DEGENERATE */
    /* numbered against those that they share faces with (orient.h); all that follows is without that */
    uint32_t turned_tets;
    uint32_t inverted_tets;    /* against the majority */
    uint32_t duplicate_tets;   /* with the same four vertices as another one, which is not counted */
    double volume;             /* the absolute value of the sum of signed volumes */

    uint64_t edges, faces;
    int64_t euler;             /* vertices that are used - edges + faces - tets */
    uint64_t overfull_faces;   /* of more than two tetrahedra */
    uint64_t same_side_faces;  /* whose two tetrahedra are listed with opposite orientations */
    uint32_t singular_vertices; /* whose link is neither a disc nor a sphere */

    uint64_t boundary_vertices, boundary_edges, boundary_faces; /* boundary: the faces of one tetrahedron */
    uint64_t boundary_singular_edges; /* with another number of boundary faces than two */
    uint32_t boundary_components;     /* parts of the boundary that share no vertex */
    double boundary_area;
};

/* Corners must be in range and different within a tetrahedron (tetmesh_validate). O(n) for bounded stars. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status mesh_check(const double *positions, const uint32_t *corners, uint32_t vertex_count,
                                             uint32_t tet_count, struct mesh_report *out, struct tetlod_error *error);

#endif
