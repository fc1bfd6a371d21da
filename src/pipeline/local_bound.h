/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Where a level is how far off: a field of its own for each controlled field. In the original it is 0; at a vertex that
 * contractions made it is the vertex's bound, max(U - s, s - L), and elsewhere what values are rounded by.
 * Interpolated, it bounds the error at every point of every level (PROOF.md, 2). It is measured and stored as any other
 * field is.
 */
#ifndef TETLOD_LOCAL_BOUND_H
#define TETLOD_LOCAL_BOUND_H

#include "src/log/contraction_log.h"
#include "src/pipeline/precision.h"

struct local_bounds {
    uint32_t first;          /* number of the first such field */
    struct tetmesh original; /* with them; what it has of the mesh is borrowed */
    double *zeros;           /* [vertex] their values in it */
};

/* The field's name: NAME bound. To be freed; NULL: no memory. */
char *local_bound_name(const char *field);

/* ERR_FIELD: the mesh has a field of the name that the local bound of this one would have. */
TETLOD_CHECKED enum tetlod_status local_bound_check(const struct tetmesh *mesh, uint32_t field,
                                                    struct tetlod_error *error);

/* Adds one for each of the log's controlled fields to the original, to its `precision` and to the log, which has kept
 * the bounds and gives them back. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status local_bounds_add(struct local_bounds *out, const struct tetmesh *original,
                                                   struct precision *precision,
                                                   struct contraction_log *log, struct tetlod_error *error);
void local_bounds_fini(struct local_bounds *bounds);

#endif
