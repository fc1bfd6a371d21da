/* SPDX-License-Identifier: BSD-3-Clause */
/* Points that move from step to step of a series: how far, as a field on the mesh of the first step. */
#ifndef TETLOD_DISPLACEMENT_H
#define TETLOD_DISPLACEMENT_H

#include "src/mesh/tetmesh.h"

/* The field's name. */
#define DISPLACEMENT_FIELD "point_displacement"

/* What is wrong with a step's tetrahedra, which are to be those of the first step, or NULL. A step may have turned some
 * over. */
const char *displacement_obstacle(const struct tetmesh *mesh, const struct tetmesh *first);

/* Do a step's points have other places than those of the first step? */
bool displacement_moves(const struct tetmesh *mesh, const struct tetmesh *first);

/* Gives a step's mesh the points and tetrahedra of the first step, and a field with how far each point has moved:
 * float32 numbers where those bring the point back bit for bit (format/SPEC.md, 3.7), else float64. *io_rounded counts
 * coordinates that neither brings back: they are off by a rounding. ERR_FIELD if there is such a field already;
 * ERR_MESH if a point moves too far; ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status displacement_take(struct tetmesh *mesh, const struct tetmesh *first,
                                                    uint64_t *io_rounded,
                                                    struct tetlod_error *error);

/* How many of the tetrahedra have the other orientation, or none, when their points have moved. */
uint64_t displacement_turned(const double *from, const double *to, const uint32_t *corners, uint32_t tets);

#endif
