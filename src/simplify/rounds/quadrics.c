/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/rounds/quadrics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

void quadrics_fini(struct quadrics *quadrics)
{
    free(quadrics->sums);
    *quadrics = (struct quadrics){0};
}

void quadrics_place(const struct quadrics *quadrics, const double p[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = (p[i] - quadrics->origin[i]) / quadrics->unit;
}

static double (*sum_of(const struct quadrics *quadrics, const struct working *working, uint32_t slot,
                       uint32_t component))[QUADRIC_SIZE]
{
    return quadrics->sums + (size_t)slot * working->component_count + component;
}

void quadrics_of(const struct quadrics *quadrics, const struct working *working, const uint32_t *simplex,
                 uint32_t count,
                 uint32_t component, double out[QUADRIC_SIZE])
{
    memset(out, 0, QUADRIC_SIZE * sizeof *out);
    for (uint32_t s = 0; s < count; s++)
        for (int i = 0; i < QUADRIC_SIZE; i++)
            out[i] += (*sum_of(quadrics, working, simplex[s], component))[i];
}

/* The gradient of the linear function with those values at the points (x, y, z, s), and six times their volume. */
static double find_gradient(const double points[4][4], double gradient[3])
{
    double edges[3][3], normals[3][3];
    for (int k = 0; k < 3; k++)
        subtract(points[k + 1], points[0], edges[k]);
    for (int k = 0; k < 3; k++)
        cross(edges[(k + 1) % 3], edges[(k + 2) % 3], normals[k]);
    double volume6 = dot(edges[0], normals[0]);
    for (int i = 0; i < 3; i++) {
        gradient[i] = 0;
        for (int k = 0; k < 3; k++)
            gradient[i] += normals[k][i] / volume6 * (points[k + 1][3] - points[0][3]);
    }
    return volume6;
}

/* Adds a tetrahedron's share to the quadrics of its corners. */
static void add_tet(struct quadrics *quadrics, const struct working *working, uint32_t tet, uint32_t component,
                    bool distance)
{
    const struct component *of = &working->components[component];
    const uint32_t *corners = working->corners[tet];
    double points[4][4], quadric[QUADRIC_SIZE] = {0}, gradient[3];
    for (int c = 0; c < 4; c++) {
        quadrics_place(quadrics, working_row(working, corners[c]), points[c]);
        points[c][3] = working_values(working, corners[c], of->field)[of->component] * of->scale;
    }
    double weight = find_gradient((const double(*)[4])points, gradient);
    if (distance)
        quadric_add_distance(quadric, (const double(*)[4])points, weight);
    else
        quadric_add_field(quadric, gradient, points[0][3] - dot(gradient, points[0]), weight);
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < QUADRIC_SIZE; i++)
            (*sum_of(quadrics, working, corners[c], component))[i] += quadric[i];
}

enum tetlod_status quadrics_init(struct quadrics *quadrics, const struct working *working, bool distance,
                                 struct tetlod_error *error)
{
    size_t n = working->slot_count, k = working->component_count;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t v = 0; v < n; v++)
        for (int i = 0; i < 3; i++) {
            low[i] = smaller(low[i], working_row(working, v)[i]);
            high[i] = larger(high[i], working_row(working, v)[i]);
        }
    double diagonal = sqrt(distance_squared(low, high));
    *quadrics = (struct quadrics){.unit = diagonal > 0 ? diagonal : 1,
                                  .sums = array_zero(n * k, sizeof *quadrics->sums)};
    memcpy(quadrics->origin, low, sizeof low);
    if (!quadrics->sums)
        return tetlodi_fail_nomem(error, "the quadrics", n * k * sizeof *quadrics->sums);
    for (uint32_t t = 0; t < working->tet_count; t++)
        for (uint32_t c = 0; c < k && working_orientation(working, t) > 0; c++)
            add_tet(quadrics, working, t, c, distance);
    return TETLOD_OK;
}

bool quadrics_optimum(const struct quadrics *quadrics, const struct working *working, const uint32_t *simplex,
                      uint32_t count,
                      double p[3])
{
    double sum[QUADRIC_SIZE] = {0}, quadric[QUADRIC_SIZE];
    for (uint32_t c = 0; c < working->component_count; c++) {
        quadrics_of(quadrics, working, simplex, count, c, quadric);
        for (int i = 0; i < QUADRIC_SIZE; i++)
            sum[i] += quadric[i];
    }
    if (!quadric_optimum(sum, p))
        return false;
    for (int i = 0; i < 3; i++)
        p[i] = quadrics->origin[i] + p[i] * quadrics->unit;
    return true;
}

void quadrics_contract(const struct quadrics *quadrics, const struct working *working, const uint32_t *simplex,
                       uint32_t count)
{
    double sum[QUADRIC_SIZE];
    for (uint32_t c = 0; c < working->component_count && quadrics->sums; c++) {
        quadrics_of(quadrics, working, simplex, count, c, sum);
        memcpy(*sum_of(quadrics, working, simplex[count - 1], c), sum, sizeof sum);
    }
}

void quadrics_renumber(struct quadrics *quadrics, const struct working *working, const struct renumbering *numbers)
{
    if (quadrics->sums)
        quadrics->sums = renumber_slots(numbers, quadrics->sums, working->component_count * sizeof *quadrics->sums);
}
