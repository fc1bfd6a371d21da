/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * How far the boundary may move before it could meet another part of it. What is on both sides of a gap, or of a thin
 * plate, or belongs to bodies that touch, may not be taken for each other: then the value at a position would be
 * another part's.
 */
#ifndef TETLOD_CLEARANCE_H
#define TETLOD_CLEARANCE_H

#include "format/tetlod.h"

/* The mesh, and its boundary faces; borrowed. */
struct clearance_mesh {
    const double *positions;
    const uint32_t *corners, *triangles; /* [4 * tet], [3 * triangle] vertices */
    uint32_t vertex_count, tet_count, triangle_count;
};

/* out[vertex]: `most`, or a fifth of the distance of its boundary faces from other parts of the boundary if that is
 * less (PROOF.md, 5); `least` at least, which is what it is inside another part of the mesh. Parts are other bodies,
 * and of the same body faces that are turned the other way. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status clearance_find(const struct clearance_mesh *mesh, double most, double least,
                                                 unsigned threads,
                                                 double *out, struct tetlod_error *error);

#endif
