/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Does a level keep its domain error? The distance of the two boundaries is looked for at vertices, at edges and inside
 * faces, from the original's faces and from the level's: a triangle is split until one face of the other boundary is
 * near enough to all of it, up to so many parts. Part by part of the boundary of the same body.
 */
#ifndef TETLOD_BOUNDARY_CHECK_H
#define TETLOD_BOUNDARY_CHECK_H

#include "src/mesh/tetmesh.h"

struct boundary_check;

/* Prepares to hold levels against a mesh (borrowed), whose bodies [vertex] (borrowed, sheets_bodies) are also those of
 * the levels' vertices; NULL: all is one. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status boundary_check_new(struct boundary_check **out, const struct tetmesh *original,
                                                     const uint32_t *bodies, unsigned threads,
                                                     struct tetlod_error *error);
void boundary_check_free(struct boundary_check *check);

/* `neighbours`: of the level, as adjacency_build makes them. *out_distance: a distance of the boundaries above `limit`,
 * or 0: none was found. From one level to the next coarser one only vertices with touched[vertex] are others (NULL: all
 * may be): faces without are known. Limits do not fall. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status boundary_check_level(struct boundary_check *check, const struct tetmesh *level,
                                                       const uint32_t *neighbours, const uint8_t *touched,
                                                       double limit, double *out_distance,
                                                       struct tetlod_error *error);

#endif
