/* SPDX-License-Identifier: BSD-3-Clause */
/* The grid that a stream's numbers lie on: (type)(origin + step * k), 0 <= k <= most < 2^bits. bits = 0: there is none,
 * and every number of the type will do. */
#ifndef TETLOD_GRID_H
#define TETLOD_GRID_H

#include <math.h>

#include "format/common/round.h"
#include "format/tetlod.h"

struct grid {
    unsigned bits;
    double origin, step, most;
};

/* The number of the type, and of the grid, that is nearest. */
static inline double grid_round(const struct grid *grid, enum tetlod_type type, double value)
{
    if (grid->bits) {
        double k = floor((value - grid->origin) / grid->step + 0.5);
        value = grid->origin + grid->step * fmin(fmax(k, 0), grid->most);
    }
    return tetlodi_round(type, value);
}

#endif
