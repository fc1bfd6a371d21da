/* SPDX-License-Identifier: BSD-3-Clause */
/* The grid that a quantised stream's numbers lie on: (type)(origin + step * k), 0 <= k < 2^bits. bits = 0: there is none, and
 * every number of the type will do. */
#ifndef TETLOD_GRID_H
#define TETLOD_GRID_H

#include <math.h>

#include "format/tetlod.h"

struct grid {
    unsigned bits;
    double origin, step;
};

/* The number of the type, and of the grid, that is nearest. */
static inline double grid_round(const struct grid *grid, enum tetlod_type type, double value)
{
    if (grid->bits) {
        double most = (double)((UINT32_C(1) << grid->bits) - 1), k = floor((value - grid->origin) / grid->step + 0.5);
        value = grid->origin + grid->step * fmin(fmax(k, 0), most);
    }
    return type == TETLOD_FLOAT32 ? (double)(float)value : value;
}

#endif
