/* SPDX-License-Identifier: BSD-3-Clause */
/* The ladder: 1, 2, 5 of every decade from 10^-6 to 1, from some error on with a step between each two; the last is the
 * greatest error asked for. More steps leave more tetrahedra and take longer (DEFAULTS.md). A table, for libraries of
 * different machines do not agree about powers. */
#ifndef TETLOD_LADDER_H
#define TETLOD_LADDER_H

#include <math.h>
#include <stdbool.h>

/* What a contraction may be above a rung's limit by the rounding of its bounds: it still counts as the limit. Exact
 * ties with round limits are common in regular meshes (PROOF.md, 3). */
static const double LIMIT_TIE = 1e-9;

/* The first rung. */
static const double FIRST_LIMIT = 1e-6;

/* Below it the ladder of the rounds has no steps between: nobody asks for what is between, and every rung looks at most
 * vertices again. */
static const double STEPS_FROM = 1e-3;

/* The rung above the limit. steps_from: the least error with steps between. *out_named: levels are named after it. */
static inline double next_limit(double limit, double most, double steps_from, bool *out_named)
{
    enum { DECADES = 6, RUNGS = 6, STEPS = 2 };
    static const double rungs[RUNGS] = {1.0, 1.5, 2.0, 3.0, 5.0, 7.0};
    static const double powers[DECADES] = {1e6, 1e5, 1e4, 1e3, 1e2, 1e1};
    double next = limit * (1 + 1e-6) < 1 ? 1 : most; // more than all of the range may be asked for: in one step
    *out_named = true;
    for (int decade = 0; decade < DECADES && next == 1; decade++)
        for (int rung = 0; rung < RUNGS && next == 1; rung++)
            if (rungs[rung] / powers[decade] > limit * (1 + 1e-6) &&
                (rung % STEPS == 0 || rungs[rung] / powers[decade] >= steps_from)) {
                next = rungs[rung] / powers[decade];
                *out_named = rung % STEPS == 0;
            }
    *out_named |= next >= most;
    return fmin(next, most);
}

#endif
