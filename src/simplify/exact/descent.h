/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * From a position that the exact limit refuses towards one that it allows. The differences at the corners of the
 * overlay, taken as fixed points, change linearly with small steps of v' and with s': the step that makes the largest
 * of them least, to first order, is found as a least squares problem whose weights grow where much is left (Lawson's
 * iteration).
 */
#ifndef TETLOD_DESCENT_H
#define TETLOD_DESCENT_H

#include "src/simplify/mesh/border.h"
#include "src/simplify/exact/examiner.h"

struct descent_component;

/* One thread's. */
struct descent {
    struct descent_component *components; /* [component] */
    double *numbers;                /* theirs */
    size_t component_capacity, number_capacity;
};

void descent_fini(struct descent *descent);

/* After exact_examine has refused a position and looked at all corners: the step from there, and the error that is
 * expected where it leads. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status descent_step(struct descent *descent, const struct examiner *examiner,
                                               const struct border *border, const struct working *working,
                                               const struct star *star, double out_step[3], double *out_error,
                                               struct tetlod_error *error);

#endif
