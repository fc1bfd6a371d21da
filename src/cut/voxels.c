/* SPDX-License-Identifier: BSD-3-Clause */
#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/cut/resample.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

void cut_voxels_fini(struct cut_voxels *voxels)
{
    free(voxels->pairs);
    *voxels = (struct cut_voxels){0};
}

/* Values of the points inside, and their range. */
static void take_inside(const struct cut_grid *grid, size_t count, bool logarithmic, struct cut_voxels *out)
{
    float low = INFINITY, high = -INFINITY;
    for (size_t i = 0; i < count; i++) {
        float value = grid->values[i];
        bool inside = !isnan(value);
        if (inside && logarithmic)
            value = log10f(value > 1e-38f ? value : 1e-38f);
        low = value < low ? value : low;
        high = value > high ? value : high;
        out->pairs[2 * i] = value;
        out->pairs[2 * i + 1] = inside;
    }
    out->range[0] = low <= high ? low : 0;
    out->range[1] = low <= high ? high : 1;
}

/* A neighbour of point i, which is the `at`-th along each axis, that is inside; or i. */
static size_t find_inside(const struct cut_grid *grid, size_t i, const uint32_t at[3])
{
    size_t stride = 1;
    for (int d = 0; d < 3; d++) {
        if (at[d] > 0 && !isnan(grid->values[i - stride]))
            return i - stride;
        if (at[d] + 1 < grid->dims[d] && !isnan(grid->values[i + stride]))
            return i + stride;
        stride *= grid->dims[d];
    }
    return i;
}

static void fill_outside(const struct cut_grid *grid, struct cut_voxels *out)
{
    uint32_t at[3];
    size_t i = 0;
    for (at[2] = 0; at[2] < grid->dims[2]; at[2]++)
        for (at[1] = 0; at[1] < grid->dims[1]; at[1]++)
            for (at[0] = 0; at[0] < grid->dims[0]; at[0]++, i++)
                if (isnan(grid->values[i])) {
                    size_t from = find_inside(grid, i, at);
                    out->pairs[2 * i] = from == i ? out->range[0] : out->pairs[2 * from];
                }
}

/* A point fades within half a step of the plane: interpolated, the plane is smooth and in its place. */
static void hide(const struct cut_grid *grid, const struct cut_plane *clip, struct cut_voxels *out)
{
    double from[3], step = 0;
    subtract(grid->origin, clip->origin, from);
    for (int d = 0; d < 3; d++)
        step += fabs(clip->normal[d]) * grid->spacing[d];
    if (!(step > 0))
        return;
    double slopes[3], start = dot(clip->normal, from) / step;
    for (int d = 0; d < 3; d++)
        slopes[d] = clip->normal[d] * grid->spacing[d] / step;
    float *seen = out->pairs + 1;
    for (uint32_t z = 0; z < grid->dims[2]; z++)
        for (uint32_t y = 0; y < grid->dims[1]; y++) {
            double row = start + y * slopes[1] + z * slopes[2];
            for (uint32_t x = 0; x < grid->dims[0]; x++, seen += 2)
                *seen *= (float)larger(smaller(0.5 - (row + x * slopes[0]), 1), 0);
        }
}

enum tetlod_status cut_make_voxels(const struct cut_grid *grid, bool logarithmic, const struct cut_plane *clip,
                                   struct cut_voxels *out, struct tetlod_error *error)
{
    size_t count = (size_t)grid->dims[0] * grid->dims[1] * grid->dims[2];
    if (!array_reserve(&out->pairs, &out->pair_cap, count, 2 * sizeof *out->pairs))
        return tetlodi_fail_nomem(error, "a volume", 8 * (uint64_t)count);
    take_inside(grid, count, logarithmic, out);
    fill_outside(grid, out);
    if (clip)
        hide(grid, clip, out);
    return TETLOD_OK;
}
