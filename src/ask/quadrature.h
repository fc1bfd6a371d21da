/* SPDX-License-Identifier: BSD-3-Clause */
/* Points of a mesh with weights, for sums in the place of integrals. */
#ifndef TETLOD_QUADRATURE_H
#define TETLOD_QUADRATURE_H

#include "src/mesh/tetmesh.h"

struct quadrature {
    size_t count;
    double *points, *weights; /* [3 * count], [count] */
    uint32_t *tets;           /* [count] that the points are in */
    double (*shares)[4];      /* [count] of the tetrahedron's corners in the point */
    double volume;
    bool has_negative; /* a weight: there are few points for many components */
};

/* `count` points, uniform in the mesh or in its part in `box` (low, then high; NULL: all of it), by `seed`. The sum of
 * the weights is the volume, and that of weights and values the integral, for every component of the mesh's fields, to
 * rounding. ERR_ARGUMENT: the box has nothing of the mesh, or there are too few points. */
TETLOD_CHECKED enum tetlod_status quadrature_make(struct quadrature *out, const struct tetmesh *mesh, const double *box,
                                                  size_t count, uint64_t seed, struct tetlod_error *error);
void quadrature_fini(struct quadrature *quadrature);

/* The field's component at point i. */
double quadrature_value(const struct quadrature *quadrature, const struct tetmesh *mesh,
                        const struct point_field *field, uint32_t component, size_t i);

#endif
