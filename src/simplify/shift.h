/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The map between the boundary that a contraction takes away and the one that it makes in its place: along one direction, the
 * mean normal. Both patches are graphs over a plane and have the same rim. The map is linear on the cells of the overlay of
 * their triangles, so what is to be known of it is known at the overlay's vertices (PROOF.md, 5).
 */
#ifndef TETLOD_SHIFT_H
#define TETLOD_SHIFT_H

#include "src/simplify/complex.h"

/* A vertex of the overlay: a point of the old patch, and the one of the new patch that it is mapped to. */
struct shift_point {
    uint32_t from[3], to[2]; /* slots */
    double from_weights[3];  /* they sum to 1 */
    double apex, to_weights[2]; /* of the result and of `to`; they sum to 1, none is negative */
    double distance;            /* widened by its rounding */
};

struct shift {
    uint32_t count;
    struct shift_point *points;
    void *faces; /* scratch */
    size_t point_room, face_room;
    bool failed; /* out of memory */
};

void shift_fini(struct shift *shift);

/* Maps the boundary of a gathered star to what contracting to p makes of it. False: there is no such map, or a face would
 * turn by more than the angle of that cosine (or memory ran out: shift->failed). No points: the boundary does not change. */
bool shift_map(struct shift *shift, const struct complex *complex, const struct star *star, const double p[3],
               double cosine);

/* The least value at the result with which, at every point of the map, the linear interpolant after is at least the one before
 * plus `per_distance` times the distance; -INFINITY: any will do; INFINITY: none does. The bounds are widened by their rounding. */
double shift_least(const struct shift *shift, const double *values, double per_distance);

/* The greatest value at the result with which the interpolant after is nowhere above the one before; INFINITY: any. */
double shift_greatest(const struct shift *shift, const double *values);

#endif
