/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/quantise.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/log/coarsening.h"
#include "src/measure/overlay_levels.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

bool quantise_wanted(const struct quantise_options *options)
{
    return options->position_bits || options->field_bits || options->position_error > 0 || options->field_error > 0;
}

bool quantise_rounds_fields(const struct quantise_options *options)
{
    return options->field_bits || options->field_error > 0;
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
    return (struct grid){bits, range[0], step > 0 ? step : fmax(fabs(range[0]), 1) * 1e-12, most};
}

/* The fewest bits for which half a step is at most `error`, a fraction of the extent. 0: none are enough. */
static unsigned bits_for(double error)
{
    for (unsigned bits = 1; bits <= QUANTISE_MAX_BITS; bits++)
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
        out->fields[f].is_ids = field->is_ids;
        memcpy(out->fields[f].values, field->values, (size_t)mesh->vertex_count * field->components * sizeof(double));
    }
    return TETLOD_OK;
}

enum tetlod_status quantise_mesh(struct tetmesh *out, const struct tetmesh *mesh,
                                 const struct quantise_options *options,
                                 struct tetlod_error *error)
{
    unsigned position_bits = choose_bits(options->position_bits, options->position_error);
    unsigned field_bits = choose_bits(options->field_bits, options->field_error);
    enum tetlod_status status = copy_mesh(out, mesh, error);
    if (status == TETLOD_OK &&
        ((options->position_error > 0 && !position_bits) || (options->field_error > 0 && !field_bits)))
        status = tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                              "quantising to that error needs more than %d bits; leave it lossless",
                              QUANTISE_MAX_BITS);
    if (status != TETLOD_OK) {
        tetmesh_fini(out);
        return status;
    }
    if (position_bits)
        round_positions(out, position_bits);
    for (uint32_t f = 0; f < out->field_count && field_bits; f++)
        if (!mesh->fields[f].is_ids)
            round_field(&out->fields[f], out->vertex_count, field_bits);
    return TETLOD_OK;
}

/* The step from end to end of a range in so many bits; 0: there is none that makes the numbers of the type fewer. */
static double cell_quantum(const double range[2], unsigned bits, bool single)
{
    double quantum = (range[1] - range[0]) / (double)((UINT32_C(1) << bits) - 1);
    double most = fmax(fabs(range[0]), fabs(range[1]));
    bool fits = quantum > 0 && quantum <= 0x1p900 && most / quantum < (single ? 0x1p22 : 0x1p50);
    return fits ? quantum : 0;
}

enum tetlod_status quantise_cells(const struct point_field *field, size_t rows, bool single,
                                  const struct quantise_options *options, struct rounded_cells *out,
                                  struct tetlod_error *error)
{
    size_t count = rows * field->components;
    unsigned bits = choose_bits(options->field_bits, options->field_error);
    double range[2] = {INFINITY, -INFINITY};
    *out = (struct rounded_cells){0};
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(field->values[i]))
            return TETLOD_OK;
        range[0] = smaller(range[0], field->values[i]);
        range[1] = larger(range[1], field->values[i]);
    }
    out->quantum = bits && count ? cell_quantum(range, bits, single) : 0;
    if (!(out->quantum > 0))
        return TETLOD_OK;
    out->values = array_new(count, sizeof *out->values);
    if (!out->values)
        return tetlodi_fail_nomem(error, field->name, count * sizeof *out->values);
    for (size_t i = 0; i < count; i++) {
        double value = out->quantum * floor(field->values[i] / out->quantum + 0.5);
        out->values[i] = tetlodi_round(single ? TETLOD_FLOAT32 : TETLOD_FLOAT64, value);
        out->error = larger(out->error, fabs(out->values[i] - field->values[i]));
    }
    return TETLOD_OK;
}

/* The most that a value moved by. */
static double changed_by(const struct point_field *now, const struct point_field *before, uint32_t vertices)
{
    double most = 0;
    for (size_t i = 0; i < (size_t)vertices * now->components; i++)
        most = fmax(most, fabs(now->values[i] - before->values[i]));
    return most;
}

double quantise_moved(const struct tetmesh *copy, const struct tetmesh *mesh)
{
    double most2 = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++)
        most2 = larger(most2, distance_squared(copy->positions + 3 * v, mesh->positions + 3 * v));
    return sqrt(most2) * (1 + 1e-12);
}

/* Where vertices have moved, thin tetrahedra may have moved by all of their height: only the overlay tells what that
 * does. */
static enum tetlod_status raise_to_overlay(const struct tetmesh *copy, const struct tetmesh *mesh, unsigned threads,
                                           double *io_most, struct tetlod_error *error)
{
    struct coarsening finest = {0};
    struct overlay_levels *overlay = NULL;
    enum tetlod_status status = TETLOD_OK;
    TETLOD_TRY_DONE(coarsening_init(&finest, copy, NULL, error));
    TETLOD_TRY_DONE(overlay_levels_new(&overlay, mesh, &finest, threads, error));
    status = overlay_levels_next(overlay, &finest, INFINITY, io_most, error);
done:
    overlay_levels_free(overlay);
    coarsening_fini(&finest);
    return status;
}

enum tetlod_status quantise_bounds(const struct tetmesh *copy, const struct tetmesh *mesh, unsigned threads,
                                   double *out, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < mesh->field_count; f++)
        out[f] = changed_by(&copy->fields[f], &mesh->fields[f], mesh->vertex_count);
    if (memcmp(copy->positions, mesh->positions, mesh->vertex_count * 3 * sizeof *copy->positions) != 0)
        TETLOD_TRY(raise_to_overlay(copy, mesh, threads, out, error));
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        double range[2];
        point_field_range(&mesh->fields[f], mesh->vertex_count, range);
        out[f] = fmin(out[f] * (1 + 1e-9), range[1] - range[0]);
    }
    return TETLOD_OK;
}
