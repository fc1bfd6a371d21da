/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * How far the boundary may move before it could meet another part of it. What is on both sides of a gap, or of a thin plate, or
 * belongs to bodies that touch, may not be taken for each other: then the value at a position would be another part's.
 */
#ifndef TETLOD_CLEARANCE_H
#define TETLOD_CLEARANCE_H

#include "format/tetlod.h"

/* out[vertex]: `most`, or a fifth of the distance of its boundary faces from other parts of the boundary if that is less (PROOF.md, 5);
 * `least` at least, which is what it is inside another part of the mesh. Parts are other bodies, and of the same body faces that
 * are turned the other way. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status clearance_find(const double *positions, uint32_t vertex_count, const uint32_t *corners,
                                                 uint32_t tet_count, double most, double least, double *out,
                                                 struct tetlod_error *error);

#endif
