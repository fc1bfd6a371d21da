/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/build/descent.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* Iterations of the weights. */
enum { ROUNDS = 12 };

/* A step as long as the star is wide costs as much as this fraction of the largest difference: it tames directions in which nothing
 * changes. */
static const double STIFFNESS = 0.05;

/* A step is no longer than this fraction of the star: the differences are not linear for long. */
static const double LONGEST_STEP = 0.5;

void descent_fini(struct descent *descent)
{
    free(descent->gradients);
    free(descent->residuals);
    *descent = (struct descent){0};
}

static bool room(double **array, size_t *capacity, size_t needed)
{
    void *grown = *array;
    bool done = array_reserve(&grown, capacity, needed, sizeof(double));
    *array = grown;
    return done;
}

/* A driver's value at v' for which the largest difference is least. */
static double best_value(const struct examiner *examiner, uint32_t d)
{
    return (examiner->intervals[d].low + examiner->intervals[d].high) / 2;
}

/* The gradients of one driver in the cones, and their mean, which serves v' itself. */
static void make_gradients(const struct examiner *examiner, const struct boundary *boundary, const struct complex *complex,
                           const struct star *star, uint32_t d, double *gradients)
{
    const struct patch *patch = &examiner->patch;
    const double *level = examiner->level + d * (size_t)patch->link_count, value = best_value(examiner, d);
    double *mean = gradients + 3 * (size_t)patch->cone_count;
    memset(mean, 0, 3 * sizeof *mean);
    for (uint32_t f = 0; f < patch->cone_count; f++) {
        const struct cone *cone = &patch->cones[f];
        double *g = gradients + 3 * (size_t)f;
        for (size_t i = 0; i < 3; i++) {
            g[i] = value * cone->apex * cone->normal[i];
            for (int k = 0; k < 3; k++)
                g[i] += level[cone->link[k]] * cone->scale[k] * patch->normals[i * patch->stride + cone->walls[k]];
        }
        boundary_follow(boundary, complex, star, g);
        for (int i = 0; i < 3; i++)
            mean[i] += g[i] / patch->cone_count;
    }
}

/* The sums of one driver's equations. */
struct sums {
    double ww, wr, wg[3]; /* of weights w of v', residuals r, changes g = w gradient */
};

/* Adds a driver's points to the matrix (its upper triangle, by rows) and the right side of the step's equations, with the change of
 * the value eliminated. */
static struct sums add_driver(const struct examiner *examiner, double factor, uint32_t width, const double *gradients,
                              const double *residuals, const double *weights, double matrix[6], double right[3])
{
    struct sums s = {0};
    for (size_t i = 0; i < examiner->point_count; i++) {
        double w = factor * examiner->points[width * i], r = residuals[i], own = weights[i], g[3];
        uint32_t cone = examiner->cones[i] == TETLOD_NONE ? examiner->patch.cone_count : examiner->cones[i];
        for (int k = 0; k < 3; k++)
            g[k] = w * gradients[3 * (size_t)cone + (size_t)k];
        s.ww += own * w * w;
        s.wr += own * w * r;
        for (int k = 0, at = 0; k < 3; k++) {
            s.wg[k] += own * w * g[k];
            right[k] += own * g[k] * r;
            for (int j = k; j < 3; j++)
                matrix[at++] += own * g[k] * g[j];
        }
    }
    for (int k = 0, at = 0; k < 3 && s.ww > 0; k++) {
        right[k] -= s.wg[k] * s.wr / s.ww;
        for (int j = k; j < 3; j++)
            matrix[at++] -= s.wg[k] * s.wg[j] / s.ww;
    }
    return s;
}

static void solve(const double m[6], double stiffness, const double right[3], double x[3])
{
    const double rows[3][3] = {{m[0] + stiffness, m[1], m[2]}, {m[1], m[3] + stiffness, m[4]}, {m[2], m[4], m[5] + stiffness}};
    double minors[3];
    for (int i = 0; i < 3; i++)
        x[i] = 0;
    cross(rows[1], rows[2], minors);
    double determinant = dot(rows[0], minors);
    for (int i = 0; i < 3 && determinant > 0; i++) { // the inverse of a symmetric matrix has the crosses of its rows as rows
        cross(rows[(i + 1) % 3], rows[(i + 2) % 3], minors);
        x[i] = dot(minors, right) / determinant;
    }
}

/* What a step and a change of the value leave of a driver's differences; the weights grow with it. Returns the largest. */
static double reweigh(const struct examiner *examiner, double factor, uint32_t width, const double *gradients,
                      const double *residuals, const double step[3], double change, double scale, double *weights)
{
    double most = 0;
    for (size_t i = 0; i < examiner->point_count; i++) {
        uint32_t cone = examiner->cones[i] == TETLOD_NONE ? examiner->patch.cone_count : examiner->cones[i];
        double w = factor * examiner->points[width * i];
        double left = fabs(residuals[i] + w * (change - dot(gradients + 3 * (size_t)cone, step)));
        weights[i] *= left * scale;
        most = larger(most, left);
    }
    return most;
}

enum tetlod_status descent_step(struct descent *descent, const struct examiner *examiner, const struct boundary *boundary,
                                const struct complex *complex, const struct fields *fields, const struct star *star,
                                double out_step[3], struct tetlod_error *error)
{
    const struct patch *patch = &examiner->patch;
    size_t points = examiner->point_count, drivers = fields->driver_count, each = 3 * ((size_t)patch->cone_count + 1);
    uint32_t width = 1 + fields->driver_count;
    if (!room(&descent->gradients, &descent->gradient_capacity, drivers * each) ||
        !room(&descent->residuals, &descent->residual_capacity, 2 * drivers * points))
        return tetlodi_fail_nomem(error, "the exact limit", 16 * drivers * points);
    double *weights = descent->residuals + drivers * points, most = 0;
    for (uint32_t d = 0; d < drivers; d++) {
        double factor = fields->drivers[d].scale * fields->drivers[d].weight, value = best_value(examiner, d);
        make_gradients(examiner, boundary, complex, star, d, descent->gradients + d * each);
        for (size_t i = 0; i < points; i++) {
            const double *point = examiner->points + width * i;
            descent->residuals[d * points + i] = factor * (point[0] * value + point[1 + d]);
            weights[d * points + i] = fabs(descent->residuals[d * points + i]);
            most = larger(most, weights[d * points + i]);
        }
    }
    for (int round = 0; round < ROUNDS && most > 0; round++) {
        double matrix[6] = {0}, right[3] = {0}, total = 0, left = 0;
        struct sums sums[drivers];
        for (uint32_t d = 0; d < drivers; d++)
            sums[d] = add_driver(examiner, fields->drivers[d].scale * fields->drivers[d].weight, width,
                                 descent->gradients + d * each, descent->residuals + d * points, weights + d * points, matrix, right);
        for (size_t i = 0; i < drivers * points; i++)
            total += weights[i];
        solve(matrix, total * STIFFNESS * STIFFNESS * most * most / (patch->reach * patch->reach), right, out_step);
        for (uint32_t d = 0; d < drivers; d++) {
            double change = sums[d].ww > 0 ? (dot(sums[d].wg, out_step) - sums[d].wr) / sums[d].ww : 0;
            left = larger(left, reweigh(examiner, fields->drivers[d].scale * fields->drivers[d].weight, width,
                                        descent->gradients + d * each, descent->residuals + d * points, out_step, change,
                                        1 / most, weights + d * points));
        }
    }
    double length = sqrt(dot(out_step, out_step)), longest = LONGEST_STEP * patch->reach;
    for (int i = 0; i < 3 && length > longest; i++)
        out_step[i] *= longest / length;
    return TETLOD_OK;
}
