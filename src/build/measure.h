/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a level really costs: its fields against the original's at every original vertex and at two points inside every
 * original tetrahedron that is not degenerate (its centroid and one at random, always the same). A point outside the level
 * is compared with the value at the closest point of its boundary.
 */
#ifndef TETLOD_MEASURE_H
#define TETLOD_MEASURE_H

#include "src/mesh/tetmesh.h"

struct measured {
    double sampled, rms; /* in the field's units; the largest over its components at each point */
};

/* Compares fields `a_fields[i]` of a with `b_fields[i]` of b (same components), for i < count, on `threads` threads. *out_domain is the domain error: the
 * largest distance of a boundary vertex of either mesh from the other's boundary, in units of length. The result does not
 * depend on the number of threads. */
TETLOD_CHECKED enum tetlod_status measure_meshes(const struct tetmesh *a, const struct tetmesh *b,
                                                 const uint32_t *a_fields, const uint32_t *b_fields, uint32_t count,
                                                 unsigned threads, struct measured *out, double *out_domain,
                                                 struct tetlod_error *error);

/* The same for all fields of the levels of one sequence, from fine to coarse: what a level has not changed is not measured
 * again. */
struct measure;
struct forest_level;
TETLOD_CHECKED enum tetlod_status measure_new(struct measure **out, const struct tetmesh *original,
                                              struct tetlod_error *error);
void measure_free(struct measure *measure);

/* `contractions` done at this level; no less than in the last call. out [field_count of the original]. */
TETLOD_CHECKED enum tetlod_status measure_level(struct measure *measure, const struct forest_level *level,
                                                uint32_t contractions, unsigned threads, struct measured *out,
                                                double *out_domain, struct tetlod_error *error);

/* Diagonal of the bounding box. */
double mesh_diagonal(const struct tetmesh *mesh);

#endif
