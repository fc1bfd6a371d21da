/* SPDX-License-Identifier: BSD-3-Clause */
/* The grids that a stream's numbers were rounded to (SPEC 5.2). Not installed. */
#ifndef TETLOD_GRIDS_H
#define TETLOD_GRIDS_H

#include "format/tetlod.h"

struct tetlodi_grid {
    double origin, step;
    unsigned bits; /* 0: the finest level has the original's numbers, bit for bit */
    enum tetlod_type type;
};

/* Of an axis of positions, and of a field. */
struct tetlodi_grid tetlodi_position_grid(const struct tetlod_file *file, unsigned axis);
struct tetlodi_grid tetlodi_field_grid(const struct tetlod_file *file, uint32_t field);

/* What the finest level has for a number of the original. */
double tetlodi_grid_value(const struct tetlodi_grid *grid, double value);

#endif
