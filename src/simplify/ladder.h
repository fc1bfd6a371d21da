/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_LADDER_H
#define TETLOD_LADDER_H

#include <math.h>
#include <stdbool.h>

/* The ladder: 1, 2, 5 of every decade with four steps between, from 10^-6 to 1; the last is the greatest error asked for. */
static inline double next_limit(double limit, double most, bool *out_named)
{
    enum { STEPS = 5 };
    static const double named[4] = {1, 2, 5, 10};
    double decade = pow(10, floor(log10(limit * (1 + 1e-9)))), next = 0;
    *out_named = false;
    for (int i = 0; i < 3 && !next; i++)
        for (int k = 1; k <= STEPS && !next; k++) {
            double step = named[i] * decade * pow(named[i + 1] / named[i], (double)k / STEPS);
            if (step > limit * (1 + 1e-6)) {
                next = k == STEPS ? named[i + 1] * decade : step;
                *out_named = k == STEPS;
            }
        }
    *out_named |= next >= most;
    return fmin(next, most);
}

#endif
