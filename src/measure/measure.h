/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a level really costs: its fields against the original's at every sample point (src/mesh/sample_points.h) where
 * the original has an interpolant. A point outside the level is compared with the value at the closest point of its
 * boundary.
 */
#ifndef TETLOD_MEASURE_H
#define TETLOD_MEASURE_H

#include "src/mesh/tetmesh.h"

struct measured {
    double sampled, rms; /* in the field's units; the largest over its components at each point */
};

struct measure;

/* Prepares to compare with a mesh, which is borrowed: its fields `fields[i]`, i < count (borrowed; NULL: all, count is
 * then field_count). ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status measure_new(struct measure **out, const struct tetmesh *original,
                                              const uint32_t *fields,
                                              uint32_t count, unsigned threads, struct tetlod_error *error);
void measure_free(struct measure *measure);

/* Compares any mesh: its fields `fields[i]` (NULL: all in order) with the original's (same components). out [count].
 * *out_domain is the domain error: the largest distance of a boundary vertex of either mesh from the other's boundary,
 * in units of length. Where the original overlaps itself or is double valued, any of its values will do. The result
 * does not depend on `threads`. */
TETLOD_CHECKED enum tetlod_status measure_mesh(const struct measure *measure, const struct tetmesh *mesh,
                                               const uint32_t *fields, unsigned threads, struct measured *out,
                                               double *out_domain, struct tetlod_error *error);

/* Diagonal of the bounding box. */
double mesh_diagonal(const struct tetmesh *mesh);

#endif
