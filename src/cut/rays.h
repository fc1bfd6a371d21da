/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a graphics processor needs to follow rays through the tetrahedra themselves. A ray enters by a face of the
 * boundary, which it finds in a tree of boxes, goes from neighbour to neighbour, and comes out by a face without one;
 * if the mesh is not convex, it enters again. What is connected to what changes with the mesh, where it lies with each
 * step of a move.
 */
#ifndef TETLOD_RAYS_H
#define TETLOD_RAYS_H

#include "src/mesh/tetmesh.h"

enum { RAYS_LEAF = 4 }; /* faces of a leaf of the tree */

/* Begins zeroed; its memory is used again. tetlod.js knows this layout. */
struct cut_rays {
    uint32_t vertex_count, tet_count, face_count, node_count;
    float *vertices;         /* [4 * vertex_count] place and value */
    const uint32_t *corners; /* [4 * tet_count] the mesh's */
    uint32_t *neighbours;    /* [4 * tet_count] as adjacency_build makes them */
    uint32_t *faces; /* [4 * face_count] of the boundary: corners, counter-clockwise seen from outside, and 4 * tet +
                      * face. A multiple of RAYS_LEAF: the last ones may be TETLOD_NONE. */
    float *nodes;    /* [8 * node_count] low corner, node to go on with behind this one's; high corner, leaf or -1. A
                      * node's first child is the next one; leaf i has faces RAYS_LEAF * i and on. */
    /* [tet_count, and as many as make a multiple of 4] values of tetrahedra, if `has_of_tets` */
    float *of_tets;
    uint32_t has_of_tets;
    size_t vertex_cap, neighbour_cap, face_cap, node_cap, of_tets_cap;
};

void cut_rays_fini(struct cut_rays *rays);

/* All but `vertices` and the boxes. The mesh's corners must stay. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status cut_rays_connect(const struct tetmesh *mesh, struct cut_rays *out,
                                                   struct tetlod_error *error);

/* Places relative to `centre`, and the boxes of the tree, of the mesh that was connected, with its vertices anywhere.
 * `of_tets`: NULL, or the values of the tetrahedra that were connected. */
TETLOD_CHECKED enum tetlod_status cut_rays_place(const struct tetmesh *mesh, const double *values,
                                                 const double *of_tets, const double centre[3], struct cut_rays *out,
                                                 struct tetlod_error *error);

#endif
