/* SPDX-License-Identifier: BSD-3-Clause */
/* The error limits of the controlled fields, as the contraction takes them: what rounding takes up is inside. */
#ifndef TETLOD_LIMITS_H
#define TETLOD_LIMITS_H

#include "src/pipeline/build_options.h"

struct limits {
    uint32_t *fields; /* [control_count] of the mesh */
    double *weights;  /* [control_count] a field's limit as a fraction of max_error */
    double max_error; /* fraction of the range */
};

/* `rounding` [field]: what rounding the mesh changed at most, in the field's units; NULL: nothing. ERR_ARGUMENT, with
 * the figure, if that alone is a field's limit. ERR_NOMEM. On failure *out is empty. */
TETLOD_CHECKED enum tetlod_status limits_set(struct limits *out, const struct build_options *options,
                                             const struct tetmesh *original,
                                             const double *rounding, struct tetlod_error *error);
void limits_fini(struct limits *limits);

#endif
