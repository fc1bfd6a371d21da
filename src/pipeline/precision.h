/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Precision that fits: the grids on which a lossless stream's levels have their field values, and the types that are
 * enough for the original's numbers. The original's exact values come in the stream's last level.
 */
#ifndef TETLOD_PRECISION_H
#define TETLOD_PRECISION_H

#include "src/mesh/tetmesh.h"

struct precision {
    struct tetmesh mesh; /* the mesh itself, its arrays borrowed, with grids and types that are enough */
    /* [field] how far the original's values on the grids are from them, at most and on average */
    double *rounding, *rounding_rms;
    bool tail; /* a field has a grid */
};

/* The mesh is borrowed. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status precision_init(struct precision *precision, const struct tetmesh *mesh,
                                                 struct tetlod_error *error);
void precision_fini(struct precision *precision);

/* Are all numbers float32 values? */
bool precision_is_narrow(const double *values, size_t count);

#endif
