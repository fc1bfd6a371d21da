/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * From a position that the exact limit refuses towards one that it allows. The differences at the corners of the overlay, taken as
 * fixed points, change linearly with small steps of v' and with s': the step that makes the largest of them least to first
 * order is found as a weighted least squares problem whose weights grow where much is left (Lawson's iteration).
 */
#ifndef TETLOD_DESCENT_H
#define TETLOD_DESCENT_H

#include "src/build/boundary.h"
#include "src/build/exact.h"

/* One thread's. */
struct descent {
    double *gradients; /* [driver][cone, then their mean][3] of the level, as far as the boundary lets v' follow */
    double *residuals; /* [driver][point] differences, as fractions of the limit's measure, and behind them their weights */
    size_t gradient_capacity, residual_capacity;
};

void descent_fini(struct descent *descent);

/* After exact_examine has refused a position and looked at all corners (horizon INFINITY): the step from there. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status descent_step(struct descent *descent, const struct examiner *examiner,
                                               const struct boundary *boundary, const struct complex *complex,
                                               const struct fields *fields, const struct star *star, double out_step[3],
                                               struct tetlod_error *error);

#endif
