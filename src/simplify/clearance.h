/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * How far the boundary may move before it could meet another part of it. What is on both sides of a gap, or of a thin plate, or
 * belongs to bodies that touch, may not be taken for each other: then the value at a position would be another part's.
 */
#ifndef TETLOD_CLEARANCE_H
#define TETLOD_CLEARANCE_H

#include "src/simplify/complex.h"

/* out[slot] of every boundary vertex: `most`, or a fifth of the distance of its boundary faces from other parts of the boundary if that
 * is less (PROOF.md, 5); 0 inside another part of the mesh. Parts are other bodies, and of the same body faces that are turned
 * the other way. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status clearance_find(const struct complex *complex, double most, double *out,
                                                 struct tetlod_error *error);

#endif
