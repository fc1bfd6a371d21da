/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a level really costs: its fields against the original's at every original vertex and at two points inside every
 * original tetrahedron that is not degenerate (its centroid and one at random, always the same). A point outside the level
 * is compared with the value at the closest point of its boundary.
 */
#ifndef TETLOD_MEASURE_H
#define TETLOD_MEASURE_H

#include "src/mesh/tetmesh.h"

enum { MEASURE_PER_TET = 2 };

struct measured {
    double sampled, rms; /* in the field's units; the largest over its components at each point */
};

/* Weights of sample `which` < MEASURE_PER_TET in a tetrahedron: the centroid, or random ones that follow from its corners'
 * positions, so that a mesh is sampled alike in whatever order it lists its vertices, tetrahedra and corners. */
void measure_sample_weights(const struct tetmesh *mesh, const uint32_t corners[4], unsigned which, double weights[4]);

struct measure;
struct ancestry_level;

/* Prepares to compare with a mesh, which is borrowed: its fields `fields[i]`, i < count (borrowed; NULL: all, count is then
 * field_count). ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status measure_new(struct measure **out, const struct tetmesh *original,
                                              const uint32_t *fields, uint32_t count, struct tetlod_error *error);
void measure_free(struct measure *measure);

/* Compares any mesh: its fields `fields[i]` with the original's (same components). out [count]. *out_domain is the domain
 * error: the largest distance of a boundary vertex of either mesh from the other's boundary, in units of length. Where the
 * original overlaps itself or is double valued, any of its values will do. The result does not depend on `threads`. */
TETLOD_CHECKED enum tetlod_status measure_mesh(struct measure *measure, const struct tetmesh *mesh,
                                               const uint32_t *fields, unsigned threads, struct measured *out,
                                               double *out_domain, struct tetlod_error *error);

/* Compares a level of the original's own sequence, from fine to coarse: what a level has not changed is not measured again.
 * `contractions` done at this level; no less than in the last call. *io_domain comes in as what the domain error is known to be
 * at least (0: nothing), which spares the search for boundary points that are nearer, and is raised to the largest of this and all
 * finer levels. Not to be mixed with measure_mesh. */
TETLOD_CHECKED enum tetlod_status measure_level(struct measure *measure, const struct ancestry_level *level,
                                                uint32_t contractions, unsigned threads, struct measured *out,
                                                double *io_domain, struct tetlod_error *error);

/* Diagonal of the bounding box. */
double mesh_diagonal(const struct tetmesh *mesh);

#endif
