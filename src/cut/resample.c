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
    double gradients[4][3], sums[4]; /* by corner; the sum of a gradient's absolute values */
    double slack[4];                 /* a weight counts as >= 0 if it is >= -slack */
};

/* Weights that a neighbour computes differ by rounding: a point on a face must not be outside both. */
#define SLACK 1e-9
#define ROUNDING 1e-14

void cut_grid_fini(struct cut_grid *grid)
{
    free(grid->values);
    free(grid->points);
    free(grid->boxes);
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

/* As tet_orientation decides. Twice the longest of three edges is a bound of the other three, and mostly enough to
 * know. */
static bool is_degenerate(const double *const p[4], double edges[3][3], double volume6)
{
    double square = TET_DEGENERATE * TET_DEGENERATE,
           size2 = 4 * larger(larger(dot(edges[0], edges[0]), dot(edges[1], edges[1])), dot(edges[2], edges[2]));
    if (volume6 * volume6 > square * size2 * size2 * size2)
        return false;
    size2 = tet_size_squared(p[0], p[1], p[2], p[3]);
    return !(volume6 * volume6 > square * size2 * size2 * size2);
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
    if (is_degenerate(p, edges, volume6))
        return false;
    double scale = 1 / volume6;
    for (int i = 0; i < 3; i++) {
        for (int c = 1; c < 4; c++)
            gradients[c][i] *= scale;
        gradients[0][i] = -(gradients[1][i] + gradients[2][i] + gradients[3][i]);
    }
    for (int c = 0; c < 4; c++) {
        frame->sums[c] = fabs(gradients[c][0]) + fabs(gradients[c][1]) + fabs(gradients[c][2]);
        frame->slack[c] = SLACK + ROUNDING * far * frame->sums[c];
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

enum { LANES = 4 };
typedef float lanes __attribute__((vector_size(16)));
typedef int32_t lane_mask __attribute__((vector_size(16)));

static inline lanes each(float x)
{
    return (lanes){x, x, x, x};
}

static inline lanes choose(lane_mask mask, lanes yes, lanes no)
{
    return (lanes)((mask & (lane_mask)yes) | (~mask & (lane_mask)no));
}

static inline bool any(lane_mask mask)
{
    uint64_t halves[2];
    memcpy(halves, &mask, sizeof halves);
    return halves[0] | halves[1];
}

/* Towards zero. */
static inline lane_mask whole(lanes x)
{
    return __builtin_convertvector(x, lane_mask);
}

static inline lanes real(lane_mask x)
{
    return __builtin_convertvector(x, lanes);
}

/* Numbers of grid points by axis (the fourth is unused). */
struct box {
    lane_mask first, last;
};

/* Boxes are found in float32, so they are a little larger: points that count in vain do no harm. */
static float box_slack(const struct cut_grid *grid)
{
    return 1e-3f + 0x1p-22f * (float)larger(larger(grid->dims[0], grid->dims[1]), grid->dims[2]);
}

/* Which of the grid's points a tetrahedron can hold; false: none. */
static inline bool find_box(const struct cut_grid *grid, float slack, const uint32_t *corners, struct box *box)
{
    lanes low, high;
    memcpy(&low, grid->boxes + 4 * (size_t)corners[0], sizeof low);
    high = low;
    for (int c = 1; c < 4; c++) {
        lanes p;
        memcpy(&p, grid->boxes + 4 * (size_t)corners[c], sizeof p);
        low = choose(p < low, p, low);
        high = choose(p > high, p, high);
    }
    const lanes most = {(float)(grid->dims[0] - 1), (float)(grid->dims[1] - 1), (float)(grid->dims[2] - 1), 0};
    low -= each(slack);
    low = choose(low > each(0), low, each(0));
    low = choose(low < most + each(1), low, most + each(1));
    high += each(slack);
    high = choose(high < most, high, most);
    high = choose(high > each(-1), high, each(-1));
    box->first = whole(low);
    box->first -= real(box->first) < low; // a comparison that holds is -1
    box->last = whole(high);
    return !any(box->first > box->last);
}

/* What is the same in all rows of one tetrahedron: the weights at the first point of its box, and what steps along the
 * axes add to them. */
struct filling {
    struct frame frame;
    lanes weights, steps[3]; /* by corner */
    lanes ramps[4];          /* by corner: what its weight grows by along four points of a row */
    float slack[4], values[4];
};

/* Weights are not larger than steps times the steps' size, and each of their few roundings to float is relative to
 * that. */
#define FLOAT_ROUNDING 0x1p-21

static void prepare(struct filling *tet, const struct box *box)
{
    static const lanes ramp = {0, 1, 2, 3};
    const double(*g)[3] = (const double(*)[3])tet->frame.gradients, *sums = tet->frame.sums, *slack = tet->frame.slack;
    double w[4], longest = 1;
    weights_at(&tet->frame, (const double[]){box->first[0], box->first[1], box->first[2]}, w);
    for (int d = 0; d < 3; d++)
        longest = larger(longest, box->last[d] - box->first[d]);
    tet->weights = (lanes){(float)w[0], (float)w[1], (float)w[2], (float)w[3]};
    for (int d = 0; d < 3; d++)
        tet->steps[d] = (lanes){(float)g[0][d], (float)g[1][d], (float)g[2][d], (float)g[3][d]};
    for (int c = 0; c < 4; c++) {
        tet->slack[c] = (float)(slack[c] + FLOAT_ROUNDING * (1 + fabs(w[c]) + longest * sums[c]));
        tet->ramps[c] = each((float)g[c][0]) * ramp;
    }
}

/* The values where four points are inside. None is beyond the corners'. */
static void put_values(float *row, const float values[4], const lanes weights[4], lane_mask inside)
{
    lanes there, found = each(values[0]), least = found, most = found;
    for (int c = 1; c < 4; c++) {
        lanes own = each(values[c]);
        found += weights[c] * (own - each(values[0]));
        least = choose(own < least, own, least);
        most = choose(own > most, own, most);
    }
    found = choose(found < least, least, found);
    found = choose(found > most, most, found);
    memcpy(&there, row, sizeof there);
    there = choose(inside, found, there);
    memcpy(row, &there, sizeof there);
}

/* Four points at a time: most tetrahedra are not larger than that. */
static void fill_row(float *row, const struct filling *tet, int32_t count, lanes first)
{
    static const lane_mask numbers = {0, 1, 2, 3};
    for (int32_t x = 0; x < count; x += LANES) {
        const lanes start = first + tet->steps[0] * each((float)x);
        lanes weights[4];
        lane_mask inside = numbers < (lane_mask){count - x, count - x, count - x, count - x};
        for (int c = 0; c < 4; c++) {
            weights[c] = each(start[c]) + tet->ramps[c];
            inside &= weights[c] >= each(-tet->slack[c]);
        }
        if (any(inside))
            put_values(row + x, tet->values, weights, inside);
    }
}

static void fill_tet(struct cut_grid *grid, float slack, const double *values, const double *of_tet,
                     const uint32_t *corners)
{
    struct filling tet;
    struct box box;
    if (!find_box(grid, slack, corners, &box))
        return;
    for (int c = 0; c < 4; c++)
        tet.frame.p[c] = grid->points + 3 * (size_t)corners[c];
    if (!make_frame(&tet.frame, grid->far))
        return;
    prepare(&tet, &box);
    for (int c = 0; c < 4; c++)
        tet.values[c] = (float)(of_tet ? *of_tet : values[corners[c]]);
    int32_t x = box.first[0], y0 = box.first[1], z0 = box.first[2], count = box.last[0] - x + 1;
    for (int32_t z = z0; z <= box.last[2]; z++)
        for (int32_t y = y0; y <= box.last[1]; y++)
            fill_row(grid->values + ((size_t)z * grid->dims[1] + (size_t)y) * grid->dims[0] + x, &tet, count,
                     tet.weights + tet.steps[1] * each((float)(y - y0)) + tet.steps[2] * each((float)(z - z0)));
}

/* Vertices as the grid counts: its points are whole numbers. */
static void place_vertices(const struct tetmesh *mesh, struct cut_grid *grid)
{
    grid->far = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        for (size_t d = 0; d < 3; d++) {
            double x = (mesh->positions[3 * v + d] - grid->origin[d]) / grid->spacing[d];
            grid->points[3 * v + d] = x;
            grid->boxes[4 * v + d] = (float)x;
            grid->far = larger(grid->far, fabs(x));
        }
        grid->boxes[4 * v + 3] = 0;
    }
    for (int d = 0; d < 3; d++) // what was subtracted had been rounded, too
        grid->far += fabs(grid->origin[d]) / grid->spacing[d];
}

enum tetlod_status cut_resample(const struct tetmesh *mesh, const double *values, const double *of_tets,
                                struct cut_grid *grid,
                                struct tetlod_error *error)
{
    double points = (double)grid->dims[0] * grid->dims[1] * grid->dims[2];
    if (points > UINT32_MAX)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "a grid of %u x %u x %u points is too large: take a coarser one",
                            grid->dims[0], grid->dims[1], grid->dims[2]);
    size_t count = (size_t)points;
    if (!ARRAY_RESERVE(grid->values, grid->value_cap, count + LANES - 1) ||
        !array_reserve(&grid->points, &grid->point_cap, mesh->vertex_count, 3 * sizeof *grid->points) ||
        !array_reserve(&grid->boxes, &grid->box_cap, mesh->vertex_count, 4 * sizeof *grid->boxes))
        return tetlodi_fail_nomem(error, "a grid", 4 * (uint64_t)count + 40 * (uint64_t)mesh->vertex_count);
    for (size_t i = 0; i < count + LANES - 1; i++)
        grid->values[i] = NAN;
    place_vertices(mesh, grid);
    float slack = box_slack(grid);
    for (size_t t = 0; t < mesh->tet_count; t++)
        fill_tet(grid, slack, values, of_tets ? of_tets + t : NULL, mesh->corners + 4 * t);
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

/* A look at every tetrahedron: of half a million it takes less than building any index, which the next level would
 * void. */
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
