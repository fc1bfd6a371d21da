/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/resample.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
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
    free(grid->points);
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
    double(*gradients)[3] = frame->gradients, edges[3][3];
    for (int c = 0; c < 3; c++)
        subtract(p[c + 1], p[0], edges[c]);
    for (int c = 0; c < 3; c++) // the gradient of a weight is normal to the opposite face
        cross(edges[(c + 1) % 3], edges[(c + 2) % 3], gradients[c + 1]);
    double volume6 = dot(edges[0], gradients[1]);
    double size2 = tet_size_squared(p[0], p[1], p[2], p[3]);
    if (!(volume6 * volume6 > TET_DEGENERATE * TET_DEGENERATE * size2 * size2 * size2))
        return false;
    double scale = 1 / volume6;
    for (int i = 0; i < 3; i++) {
        for (int c = 1; c < 4; c++)
            gradients[c][i] *= scale;
        gradients[0][i] = -(gradients[1][i] + gradients[2][i] + gradients[3][i]);
    }
    for (int c = 0; c < 4; c++)
        frame->slack[c] = SLACK + ROUNDING * far * (fabs(gradients[c][0]) + fabs(gradients[c][1]) + fabs(gradients[c][2]));
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

/* The numbers of the grid's points that are between two coordinates, which count its points; false if there are none. */
static bool index_range(uint32_t count, double low, double high, uint32_t out[2])
{
    double first = larger(low - SLACK, 0), last = smaller(high + SLACK, count - 1.0);
    if (!(first <= last))
        return false;
    out[0] = (uint32_t)first;
    out[0] += out[0] < first;
    out[1] = (uint32_t)last;
    return out[0] <= out[1];
}

/* What is the same in all rows of one tetrahedron. */
struct filling {
    struct frame frame;
    double per_step[4];      /* steps along a row in which a weight changes by 1; 0: it does not change */
    double value, slopes[3]; /* at corner 0 */
    double least, most;      /* a value of the tetrahedron is never beyond its corners' */
};

static void prepare(struct filling *tet, const double *values, const uint32_t *corners)
{
    tet->value = tet->least = tet->most = values[corners[0]];
    tet->slopes[0] = tet->slopes[1] = tet->slopes[2] = 0;
    for (int c = 0; c < 4; c++) {
        const double *gradient = tet->frame.gradients[c];
        double value = values[corners[c]];
        tet->per_step[c] = gradient[0] != 0 ? 1 / gradient[0] : 0;
        tet->least = smaller(tet->least, value);
        tet->most = larger(tet->most, value);
        for (int i = 0; i < 3; i++)
            tet->slopes[i] += (value - tet->value) * gradient[i];
    }
}

/* The points of one row that are inside are an interval: weights are linear along it. */
static void fill_row(struct cut_grid *grid, const struct filling *tet, const uint32_t range[2], const double point[3], size_t row)
{
    const double *o = tet->frame.p[0];
    double weights[4], first = 0, last = range[1] - range[0];
    weights_at(&tet->frame, point, weights);
    for (int c = 0; c < 4; c++) {
        double per_step = tet->per_step[c], room = weights[c] + tet->frame.slack[c], zero = -room * per_step;
        if (per_step == 0 && room < 0)
            return;
        first = larger(first, per_step > 0 ? zero : 0);
        last = smaller(last, per_step < 0 ? zero : last);
    }
    if (!(first <= last))
        return;
    double value = tet->value + tet->slopes[0] * (point[0] - o[0]) + tet->slopes[1] * (point[1] - o[1]) +
                   tet->slopes[2] * (point[2] - o[2]);
    for (uint32_t i = (uint32_t)first + ((uint32_t)first < first); i <= last; i++) {
        grid->values[row + range[0] + i] = (float)smaller(larger(value + i * tet->slopes[0], tet->least), tet->most);
        grid->inside[row + range[0] + i] = 1;
    }
}

static void fill_tet(struct cut_grid *grid, const double *values, const uint32_t *corners)
{
    struct filling tet;
    uint32_t range[3][2];
    double far = 0;
    for (int c = 0; c < 4; c++)
        tet.frame.p[c] = grid->points + 3 * (size_t)corners[c];
    const double *const *p = tet.frame.p;
    for (int d = 0; d < 3; d++) {
        double low = smaller(smaller(p[0][d], p[1][d]), smaller(p[2][d], p[3][d]));
        double high = larger(larger(p[0][d], p[1][d]), larger(p[2][d], p[3][d]));
        if (!index_range(grid->dims[d], low, high, range[d]))
            return;
        far = larger(far, larger(-low, high));
    }
    if (!make_frame(&tet.frame, far + grid->offset))
        return;
    prepare(&tet, values, corners);
    for (uint32_t z = range[2][0]; z <= range[2][1]; z++)
        for (uint32_t y = range[1][0]; y <= range[1][1]; y++)
            fill_row(grid, &tet, range[0], (const double[]){range[0][0], y, z},
                     ((size_t)z * grid->dims[1] + y) * grid->dims[0]);
}

/* Vertices as the grid counts: its points are whole numbers. */
static void place_vertices(const struct tetmesh *mesh, struct cut_grid *grid)
{
    grid->offset = 0;
    for (int d = 0; d < 3; d++)
        grid->offset = larger(grid->offset, fabs(grid->origin[d]) / grid->spacing[d]);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        for (size_t d = 0; d < 3; d++)
            grid->points[3 * v + d] = (mesh->positions[3 * v + d] - grid->origin[d]) / grid->spacing[d];
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
        !array_reserve((void **)&grid->inside, &grid->inside_cap, count, 1) ||
        !array_reserve((void **)&grid->points, &grid->point_cap, mesh->vertex_count, 3 * sizeof *grid->points))
        return tetlodi_fail_nomem(error, "a grid", 5 * (uint64_t)count + 24 * (uint64_t)mesh->vertex_count);
    memset(grid->inside, 0, count);
    for (size_t i = 0; i < count; i++)
        grid->values[i] = 0;
    place_vertices(mesh, grid);
    for (size_t t = 0; t < mesh->tet_count; t++)
        fill_tet(grid, values, mesh->corners + 4 * t);
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
