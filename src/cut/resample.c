/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/resample.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* Barycentric weights of corners 1..3 as linear functions of the vector from corner 0. */
struct frame {
    const double *p[4];
    double gradients[4][3], slack[4]; /* by corner; a weight counts as >= 0 if it is >= -slack */
};

/* Weights that a neighbour computes differ by rounding: a point on a face must not be outside both. */
#define SLACK 1e-9
#define ROUNDING 1e-14

void cut_grid_fini(struct cut_grid *grid)
{
    free(grid->values);
    free(grid->inside);
    *grid = (struct cut_grid){0};
}

void cut_grid_cover(struct cut_grid *grid, const double low[3], const double high[3], uint32_t size)
{
    double longest = larger(larger(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
    double step = longest > 0 ? longest / (size - 1) : 1;
    for (int d = 0; d < 3; d++) {
        double extent = high[d] - low[d], cells = larger(floor(extent / step + 0.5), 1);
        grid->dims[d] = (uint32_t)cells + 1;
        grid->origin[d] = low[d];
        grid->spacing[d] = extent > 0 ? extent / cells : step;
    }
}

/* False for a degenerate tetrahedron. `far` is the largest coordinate, which rounding is relative to. */
static bool make_frame(struct frame *frame, double far)
{
    const double *const *p = frame->p;
    if (tet_orientation(p[0], p[1], p[2], p[3]) == 0)
        return false;
    double scale = 1 / tet_volume6(p[0], p[1], p[2], p[3]);
    for (int c = 1; c < 4; c++) { // the gradient of a weight is normal to the opposite face
        const double *q = p[c % 3 + 1], *r = p[(c + 1) % 3 + 1];
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            frame->gradients[c][i] = scale * ((q[j] - p[0][j]) * (r[k] - p[0][k]) - (q[k] - p[0][k]) * (r[j] - p[0][j]));
        }
    }
    for (int i = 0; i < 3; i++)
        frame->gradients[0][i] = -(frame->gradients[1][i] + frame->gradients[2][i] + frame->gradients[3][i]);
    for (int c = 0; c < 4; c++) {
        const double *g = frame->gradients[c];
        frame->slack[c] = SLACK + ROUNDING * far * (fabs(g[0]) + fabs(g[1]) + fabs(g[2]));
    }
    return true;
}

static void weights_at(const struct frame *frame, const double point[3], double weights[4])
{
    const double *o = frame->p[0];
    double x = point[0] - o[0], y = point[1] - o[1], z = point[2] - o[2];
    for (int c = 1; c < 4; c++) {
        const double *g = frame->gradients[c];
        weights[c] = g[0] * x + g[1] * y + g[2] * z;
    }
    weights[0] = 1 - weights[1] - weights[2] - weights[3];
}

/* ---- a grid ---- */

/* Indices of the grid's points between two coordinates; false if there are none. */
static bool index_range(const struct cut_grid *grid, int d, double low, double high, uint32_t out[2])
{
    double first = ceil((low - grid->origin[d]) / grid->spacing[d] - SLACK);
    double last = floor((high - grid->origin[d]) / grid->spacing[d] + SLACK);
    first = larger(first, 0);
    last = smaller(last, grid->dims[d] - 1.0);
    if (!(first <= last))
        return false;
    out[0] = (uint32_t)first;
    out[1] = (uint32_t)last;
    return true;
}

/* The points of one row that are inside are an interval: weights are linear along it. */
static void fill_row(struct cut_grid *grid, const struct frame *frame, const double values[4], const uint32_t range[2],
                     const double point[3], size_t row)
{
    double weights[4], first = 0, last = range[1] - range[0], value = 0, slope = 0;
    weights_at(frame, point, weights);
    for (int c = 0; c < 4; c++) {
        double step = frame->gradients[c][0] * grid->spacing[0], room = weights[c] + frame->slack[c];
        if (step > 0)
            first = larger(first, -room / step);
        else if (step < 0)
            last = smaller(last, -room / step);
        else if (room < 0)
            return;
        value += weights[c] * values[c];
        slope += step * values[c];
    }
    if (!(first <= last))
        return;
    double least = smaller(smaller(values[0], values[1]), smaller(values[2], values[3]));
    double most = larger(larger(values[0], values[1]), larger(values[2], values[3]));
    uint32_t end = (uint32_t)floor(last);
    for (uint32_t i = (uint32_t)ceil(first); i <= end; i++) {
        grid->values[row + range[0] + i] = (float)smaller(larger(value + i * slope, least), most);
        grid->inside[row + range[0] + i] = 1;
    }
}

static void fill_tet(const struct tetmesh *mesh, const double *values, const uint32_t *corners, struct cut_grid *grid)
{
    struct frame frame;
    uint32_t range[3][2];
    double far = 0, at[4];
    for (int c = 0; c < 4; c++)
        frame.p[c] = mesh->positions + 3 * (size_t)corners[c];
    const double *const *p = frame.p;
    for (int d = 0; d < 3; d++) {
        double low = smaller(smaller(p[0][d], p[1][d]), smaller(p[2][d], p[3][d]));
        double high = larger(larger(p[0][d], p[1][d]), larger(p[2][d], p[3][d]));
        if (!index_range(grid, d, low, high, range[d]))
            return;
        far = larger(far, larger(-low, high));
    }
    if (!make_frame(&frame, far))
        return;
    for (int c = 0; c < 4; c++)
        at[c] = values[corners[c]];
    double point[3] = {grid->origin[0] + range[0][0] * grid->spacing[0]};
    for (uint32_t z = range[2][0]; z <= range[2][1]; z++)
        for (uint32_t y = range[1][0]; y <= range[1][1]; y++) {
            point[1] = grid->origin[1] + y * grid->spacing[1];
            point[2] = grid->origin[2] + z * grid->spacing[2];
            fill_row(grid, &frame, at, range[0], point, ((size_t)z * grid->dims[1] + y) * grid->dims[0]);
        }
}

enum tetlod_status cut_resample(const struct tetmesh *mesh, const double *values, struct cut_grid *grid,
                                struct tetlod_error *error)
{
    double points = (double)grid->dims[0] * grid->dims[1] * grid->dims[2];
    if (points > UINT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "a grid of %u x %u x %u points is too large: take a coarser one",
                            grid->dims[0], grid->dims[1], grid->dims[2]);
    size_t count = (size_t)points;
    if (!array_reserve((void **)&grid->values, &grid->value_cap, count, sizeof *grid->values) ||
        !array_reserve((void **)&grid->inside, &grid->inside_cap, count, 1))
        return tetlodi_fail_nomem(error, "a grid", 5 * (uint64_t)count);
    memset(grid->inside, 0, count);
    for (size_t i = 0; i < count; i++)
        grid->values[i] = 0;
    for (size_t t = 0; t < mesh->tet_count; t++)
        fill_tet(mesh, values, mesh->corners + 4 * t, grid);
    return TETLOD_OK;
}

/* ---- a point ---- */

static bool near_box(const double *const p[4], const double point[3], double reach)
{
    for (int d = 0; d < 3; d++) {
        double low = smaller(smaller(p[0][d], p[1][d]), smaller(p[2][d], p[3][d]));
        double high = larger(larger(p[0][d], p[1][d]), larger(p[2][d], p[3][d]));
        if (point[d] < low - reach || point[d] > high + reach)
            return false;
    }
    return true;
}

/* How far the point is beyond the face that it is farthest beyond; 0 inside. */
static double beyond(const struct frame *frame, const double weights[4])
{
    double most = 0;
    for (int c = 0; c < 4; c++) {
        const double *g = frame->gradients[c];
        if (weights[c] < -frame->slack[c])
            most = larger(most, -weights[c] / sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]));
    }
    return most;
}

static void clamp(double weights[4])
{
    double sum = 0;
    for (int c = 0; c < 4; c++)
        sum += weights[c] = larger(weights[c], 0);
    for (int c = 0; c < 4; c++)
        weights[c] /= sum;
}

/* A look at every tetrahedron: of half a million it takes less than building any index, which the next level would void. */
uint32_t cut_probe(const struct tetmesh *mesh, const double p[3], double reach, double weights[4])
{
    uint32_t best = TETLOD_NONE;
    double least = reach, far = larger(larger(fabs(p[0]), fabs(p[1])), fabs(p[2])) + reach;
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        struct frame frame;
        double own[4];
        for (int c = 0; c < 4; c++)
            frame.p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)t + c];
        if (!near_box(frame.p, p, reach) || !make_frame(&frame, far))
            continue;
        weights_at(&frame, p, own);
        double distance = beyond(&frame, own);
        if (distance < least || (distance == least && best == TETLOD_NONE)) {
            best = t;
            least = distance;
            memcpy(weights, own, sizeof own);
        }
        if (distance == 0)
            break;
    }
    if (best != TETLOD_NONE)
        clamp(weights);
    return best;
}
