/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/build/quantise.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

bool quantise_wanted(const struct quantise_options *options)
{
    return options->position_bits || options->field_bits || options->position_error > 0 || options->field_error > 0;
}

static void bounds_of(const double *values, size_t count, size_t stride, double range[2])
{
    range[0] = range[1] = values[0];
    for (size_t i = 1; i < count; i++) {
        range[0] = fmin(range[0], values[i * stride]);
        range[1] = fmax(range[1], values[i * stride]);
    }
}

/* A grid from end to end of a range. What has no extent still gets a step. */
static struct grid make_grid(const double range[2], unsigned bits)
{
    double most = (double)((UINT32_C(1) << bits) - 1), step = range[1] / most - range[0] / most;
    return (struct grid){bits, range[0], step > 0 ? step : fmax(fabs(range[0]), 1) * 1e-12};
}

/* The fewest bits for which half a step is at most `error`, a fraction of the extent. 0: none are enough. */
static unsigned bits_for(double error)
{
    for (unsigned bits = 1; bits <= QUANTISE_MOST_BITS; bits++)
        if (0.5 / (double)((UINT32_C(1) << bits) - 1) <= error)
            return bits;
    return 0;
}

static unsigned choose_bits(unsigned bits, double error)
{
    return bits ? bits : error > 0 ? bits_for(error) : 0;
}

static void round_positions(struct tetmesh *mesh, unsigned bits)
{
    for (unsigned axis = 0; axis < 3; axis++) {
        double range[2];
        bounds_of(mesh->positions + axis, mesh->vertex_count, 3, range);
        mesh->position_grid[axis] = make_grid(range, bits);
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            double *x = &mesh->positions[3 * v + axis];
            *x = grid_round(&mesh->position_grid[axis], mesh->position_type, *x);
        }
    }
}

static void round_field(struct point_field *field, uint32_t vertices, unsigned bits)
{
    double range[2];
    point_field_range(field, vertices, range);
    field->grid = make_grid(range, bits);
    for (size_t i = 0; i < (size_t)vertices * field->components; i++)
        field->values[i] = grid_round(&field->grid, field->type, field->values[i]);
}

static enum tetlod_status copy_mesh(struct tetmesh *out, const struct tetmesh *mesh, struct tetlod_error *error)
{
    *out = (struct tetmesh){.vertex_count = mesh->vertex_count,
                            .tet_count = mesh->tet_count,
                            .position_type = mesh->position_type,
                            .unused_points = mesh->unused_points};
    out->positions = array_new(mesh->vertex_count, 3 * sizeof(double));
    out->corners = array_new(mesh->tet_count, 4 * sizeof(uint32_t));
    if (!out->positions || !out->corners)
        return tetlodi_fail_nomem(error, "the rounded mesh", (uint64_t)mesh->vertex_count * 24);
    memcpy(out->positions, mesh->positions, mesh->vertex_count * 3 * sizeof(double));
    memcpy(out->corners, mesh->corners, mesh->tet_count * 4 * sizeof(uint32_t));
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        const struct point_field *field = &mesh->fields[f];
        TETLOD_TRY(tetmesh_add_field(out, field->name, field->components, field->type, error));
        memcpy(out->fields[f].values, field->values, (size_t)mesh->vertex_count * field->components * sizeof(double));
    }
    return TETLOD_OK;
}

enum tetlod_status quantise_mesh(struct tetmesh *out, const struct tetmesh *mesh, const struct quantise_options *options,
                                 struct tetlod_error *error)
{
    unsigned position_bits = choose_bits(options->position_bits, options->position_error);
    unsigned field_bits = choose_bits(options->field_bits, options->field_error);
    enum tetlod_status status = copy_mesh(out, mesh, error);
    if (status == TETLOD_OK &&
        ((options->position_error > 0 && !position_bits) || (options->field_error > 0 && !field_bits)))
        status = tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "quantising to that error needs more than %d bits; leave it lossless",
                              QUANTISE_MOST_BITS);
    if (status != TETLOD_OK) {
        tetmesh_fini(out);
        return status;
    }
    if (position_bits)
        round_positions(out, position_bits);
    for (uint32_t f = 0; f < out->field_count && field_bits; f++)
        round_field(&out->fields[f], out->vertex_count, field_bits);
    return TETLOD_OK;
}

/* Length of a linear function's gradient on a tetrahedron; infinite if it is degenerate. */
static double steepness(const double *const p[4], const double s[4])
{
    double volume6 = tet_volume6(p[0], p[1], p[2], p[3]), g[3] = {0, 0, 0}, e[3][3];
    if (tet_orientation(p[0], p[1], p[2], p[3]) == 0)
        return INFINITY;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            e[k][i] = p[k + 1][i] - p[0][i];
    for (int k = 0; k < 3; k++) {
        const double *a = e[(k + 1) % 3], *b = e[(k + 2) % 3];
        double difference = (s[k + 1] - s[0]) / volume6;
        g[0] += difference * (a[1] * b[2] - a[2] * b[1]);
        g[1] += difference * (a[2] * b[0] - a[0] * b[2]);
        g[2] += difference * (a[0] * b[1] - a[1] * b[0]);
    }
    return sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
}

static double steepest(const struct tetmesh *mesh, const struct point_field *field)
{
    double most = 0;
    for (size_t t = 0; t < mesh->tet_count; t++)
        for (uint32_t c = 0; c < field->components; c++) {
            const double *p[4];
            double s[4];
            for (size_t k = 0; k < 4; k++) {
                size_t v = mesh->corners[4 * t + k];
                p[k] = mesh->positions + 3 * v;
                s[k] = field->values[v * field->components + c];
            }
            if (s[0] != s[1] || s[0] != s[2] || s[0] != s[3])
                most = fmax(most, steepness(p, s));
        }
    return most;
}

double quantise_bound(const struct tetmesh *copy, const struct tetmesh *mesh, uint32_t field)
{
    const struct point_field *now = &copy->fields[field], *before = &mesh->fields[field];
    double moved2 = 0, changed = 0, range[2];
    for (size_t v = 0; v < mesh->vertex_count; v++)
        moved2 = fmax(moved2, distance_squared(copy->positions + 3 * v, mesh->positions + 3 * v));
    for (size_t i = 0; i < (size_t)mesh->vertex_count * now->components; i++)
        changed = fmax(changed, fabs(now->values[i] - before->values[i]));
    point_field_range(before, mesh->vertex_count, range);
    double bound = changed + (moved2 > 0 ? sqrt(moved2) * steepest(copy, now) : 0);
    return fmin(bound * (1 + 1e-9), range[1] - range[0]);
}
