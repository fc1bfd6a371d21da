/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/exact/descent.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* Iterations of the weights. */
enum { ROUNDS = 12 };

/* A step as long as the star is wide costs as much as this fraction of the largest difference: it tames directions in
 * which nothing changes. */
static const double STIFFNESS = 0.05;

/* A step is no longer than this fraction of the star: the differences are not linear for long. */
static const double LONGEST_STEP = 0.5;

/* One component's part of the problem. With the step x and the change c of the value, the difference at a corner
 * becomes residual + w (c - gradient . x), w its weight of v'. */
struct descent_component {
    double factor;     /* of its differences: it makes them fractions of the range, worst weighted */
    double *gradients; /* [cone, then their mean][3] of the level, as far as the boundary lets v' follow */
    double *residuals, *weights; /* [corner] */
    double ww, wr, wg[3];        /* weighted sums of w w, w residual, w w gradient */
};

void descent_fini(struct descent *descent)
{
    free(descent->components);
    free(descent->numbers);
    *descent = (struct descent){0};
}

static double weight_of(const struct examiner *examiner, const struct working *working,
                        const struct descent_component *component,
                        size_t corner)
{
    return component->factor * examiner->points[(1 + (size_t)working->component_count) * corner];
}

/* v' itself is in all cones. */
static const double *gradient_at(const struct examiner *examiner, const struct descent_component *component,
                                 size_t corner)
{
    uint32_t cone = examiner->cones[corner];
    return component->gradients + 3 * (size_t)(cone == TETLOD_NONE ? examiner->cover.cone_count : cone);
}

static void make_gradients(const struct examiner *examiner, const struct border *border, const struct working *working,
                           const struct star *star, const double *level, double value, double *gradients)
{
    const struct cover *cover = &examiner->cover;
    double *mean = gradients + 3 * (size_t)cover->cone_count;
    memset(mean, 0, 3 * sizeof *mean);
    for (uint32_t f = 0; f < cover->cone_count; f++) {
        const struct cone *cone = &cover->cones[f];
        double *g = gradients + 3 * (size_t)f;
        for (size_t i = 0; i < 3; i++) {
            g[i] = value * cone->apex * cone->normal[i];
            for (int k = 0; k < 3; k++)
                g[i] += level[cone->link[k]] * cone->scale[k] * cover->normals[i * cover->stride + cone->walls[k]];
        }
        border_follow(border, working, star->simplex, star->simplex_count, g);
        for (int i = 0; i < 3; i++)
            mean[i] += g[i] / cover->cone_count;
    }
}

/* Takes up a component, at the value with which the largest difference is least. Returns that. */
static double open_component(struct descent_component *component, const struct examiner *examiner,
                             const struct border *border,
                          const struct working *working, const struct star *star, uint32_t d)
{
    double value = (examiner->intervals[d].low + examiner->intervals[d].high) / 2, most = 0;
    component->factor = working->components[d].factor;
    make_gradients(examiner, border, working, star, examiner->level + d * (size_t)examiner->cover.link_count, value,
                   component->gradients);
    for (size_t i = 0; i < examiner->point_count; i++) {
        double constant = examiner->points[(1 + (size_t)working->component_count) * i + 1 + d];
        component->residuals[i] = weight_of(examiner, working, component, i) * value + component->factor * constant;
        component->weights[i] = fabs(component->residuals[i]);
        most = larger(most, component->weights[i]);
    }
    return most;
}

/* Adds a component to the step's equations, the change of its value eliminated: to the matrix' upper triangle, row by
 * row, and to the right side. Returns the sum of its weights. */
static double add_equations(struct descent_component *component, const struct examiner *examiner,
                            const struct working *working,
                            double matrix[6], double right[3])
{
    double total = 0;
    component->ww = component->wr = component->wg[0] = component->wg[1] = component->wg[2] = 0;
    for (size_t i = 0; i < examiner->point_count; i++) {
        const double *gradient = gradient_at(examiner, component, i);
        double w = weight_of(examiner, working, component, i), own = component->weights[i], r = component->residuals[i];
        total += own;
        component->ww += own * w * w;
        component->wr += own * w * r;
        for (int k = 0, at = 0; k < 3; k++) {
            double along = own * w * gradient[k];
            component->wg[k] += along * w;
            right[k] += along * r;
            for (int j = k; j < 3; j++)
                matrix[at++] += along * w * gradient[j];
        }
    }
    for (int k = 0, at = 0; k < 3 && component->ww > 0; k++) {
        right[k] -= component->wg[k] * component->wr / component->ww;
        for (int j = k; j < 3; j++)
            matrix[at++] -= component->wg[k] * component->wg[j] / component->ww;
    }
    return total;
}

/* Solves (matrix + stiffness) x = right. */
static void solve(const double m[6], double stiffness, const double right[3], double x[3])
{
    const double rows[3][3] = {{m[0] + stiffness, m[1], m[2]}, {m[1], m[3] + stiffness, m[4]},
                               {m[2], m[4], m[5] + stiffness}};
    double minors[3];
    cross(rows[1], rows[2], minors);
    double determinant = dot(rows[0], minors);
    for (int i = 0; i < 3; i++) { // of a symmetric matrix' inverse these are the rows
        cross(rows[(i + 1) % 3], rows[(i + 2) % 3], minors);
        x[i] = determinant > 0 ? dot(minors, right) / determinant : 0;
    }
}

/* What the step, with the change of the value that is best there, leaves of a component's differences: weights grow
 * with it. Returns the largest. */
static double reweigh(struct descent_component *component, const struct examiner *examiner,
                      const struct working *working,
                      const double step[3], double most)
{
    double change = component->ww > 0 ? (dot(component->wg, step) - component->wr) / component->ww : 0, largest = 0;
    for (size_t i = 0; i < examiner->point_count; i++) {
        double left = fabs(component->residuals[i] + weight_of(examiner, working, component, i) *
                                                      (change - dot(gradient_at(examiner, component, i), step)));
        component->weights[i] *= left / most;
        largest = larger(largest, left);
    }
    return largest;
}

static bool make_room(struct descent *descent, const struct examiner *examiner, uint32_t components)
{
    size_t gradients = 3 * ((size_t)examiner->cover.cone_count + 1), points = examiner->point_count;
    if (!ARRAY_RESERVE(descent->components, descent->component_capacity, components) ||
        !ARRAY_RESERVE(descent->numbers, descent->number_capacity, components * (gradients + 2 * points)))
        return false;
    double *next = descent->numbers;
    for (uint32_t d = 0; d < components; d++, next += gradients + 2 * points)
        descent->components[d] = (struct descent_component){
            .gradients = next, .residuals = next + gradients, .weights = next + gradients + points};
    return true;
}

enum tetlod_status descent_step(struct descent *descent, const struct examiner *examiner, const struct border *border,
                                const struct working *working, const struct star *star,
                                double out_step[3], double *out_error, struct tetlod_error *error)
{
    double most = 0, reach = examiner->cover.reach, longest = LONGEST_STEP * reach;
    if (!make_room(descent, examiner, working->component_count))
        return tetlodi_fail_nomem(error, "the exact limit", 16 * examiner->point_count);
    for (uint32_t d = 0; d < working->component_count; d++)
        most = larger(most, open_component(&descent->components[d], examiner, border, working, star, d));
    *out_error = most;
    memset(out_step, 0, 3 * sizeof *out_step);
    for (int round = 0; round < ROUNDS && most > 0; round++) {
        double matrix[6] = {0}, right[3] = {0}, total = 0;
        for (uint32_t d = 0; d < working->component_count; d++)
            total += add_equations(&descent->components[d], examiner, working, matrix, right);
        solve(matrix, total * STIFFNESS * STIFFNESS * most * most / (reach * reach), right, out_step);
        *out_error = 0;
        for (uint32_t d = 0; d < working->component_count; d++)
            *out_error = larger(*out_error, reweigh(&descent->components[d], examiner, working, out_step, most));
    }
    double length = sqrt(dot(out_step, out_step));
    for (int i = 0; i < 3 && length > longest; i++)
        out_step[i] *= longest / length;
    return TETLOD_OK;
}
