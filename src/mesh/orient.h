/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Numbering against orientation. Some programs list the corners of a tetrahedron in either turn. Two tetrahedra that
 * share a face lie on both sides of it, whatever their numbering says, as long as none of them is really inverted: so
 * numbering is made consistent through faces, and what is still negative then overlaps its neighbours.
 */
#ifndef TETLOD_ORIENT_H
#define TETLOD_ORIENT_H

#include "src/mesh/tetmesh.h"

/* The corners of a mesh in one turn throughout. */
struct oriented {
    uint32_t *corners; /* owned; NULL: the mesh's own are */
    uint8_t *turned;   /* owned, [tet] 1: two corners changed places; NULL with the corners */
    uint32_t turned_count;
};

/* Turns tetrahedra so that those that share a face are numbered alike. Parts that hang together through faces are
 * turned as their majority is, then as the largest volume; a part that no numbering makes consistent (folds, twists)
 * stays as it is. `neighbours` as adjacency_build makes them, or NULL. On failure *out is empty. O(n). ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status orient(struct oriented *out, const double *positions, const uint32_t *corners,
                                         uint32_t vertex_count, uint32_t tet_count, const uint32_t *neighbours,
                                         struct tetlod_error *error);
void oriented_fini(struct oriented *oriented);

/* Whether the face of a slot (4 * tet + face) is listed in the same turn by both its tetrahedra: by their numbering,
 * they lie on one side of it. */
bool same_turn(const uint32_t *corners, const uint32_t *neighbours, size_t slot);

#endif
