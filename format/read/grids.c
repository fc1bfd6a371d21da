/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/grids.h"

#include "format/read/reader.h"

static struct tetlodi_grid grid_of(const struct tetlodi_scale *scale, unsigned axis, int exact)
{
    return (struct tetlodi_grid){scale->origin[axis], scale->step[axis], exact ? 0 : scale->bits, scale->type};
}

struct tetlodi_grid tetlodi_position_grid(const struct tetlod_file *file, unsigned axis)
{
    return grid_of(&file->index.scales[0], axis, 0);
}

struct tetlodi_grid tetlodi_field_grid(const struct tetlod_file *file, uint32_t field)
{
    return grid_of(&file->index.scales[1 + field], 0, file->index.exact_later[field]);
}

double tetlodi_grid_value(const struct tetlodi_grid *grid, double value)
{
    const struct tetlodi_scale scale = {grid->type, grid->type, grid->bits, {grid->origin}, {grid->step}};
    return grid->bits ? scale_value(&scale, 0, scale_code(&scale, 0, value)) : value;
}
