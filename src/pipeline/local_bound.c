/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/local_bound.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* The largest bound has so many steps of its field's grid at least. */
static const double MIN_STEPS = 1 << 15;

/* A step is the range divided by this, by powers of ten, and by powers of two: so multiples of 0.01 % of the range, and
 * of a hundredth of that and so on, are multiples of it, and a level of a round error does not pass that by its bounds
 * being rounded up. */
static const double STEPS_OF_RANGE = 40000;

/* A tie with a multiple (ladder.h), which the promise allows. */
static const double TIE = 1e-9;

char *local_bound_name(const char *field)
{
    size_t size = strlen(field) + sizeof TETLOD_BOUND_SUFFIX;
    char *name = array_new(size, 1);
    if (name)
        snprintf(name, size, "%s%s", field, TETLOD_BOUND_SUFFIX);
    return name;
}

enum tetlod_status local_bound_check(const struct tetmesh *mesh, uint32_t field, struct tetlod_error *error)
{
    char *name = local_bound_name(mesh->fields[field].name);
    enum tetlod_status status = TETLOD_OK;
    if (!name)
        status = tetlodi_fail_nomem(error, "a field's name", strlen(mesh->fields[field].name));
    else if (tetmesh_find_field(mesh, name) != TETLOD_NONE)
        status = tetlodi_fail(error, TETLOD_ERR_FIELD,
                              "--local-bound: it has a field '%.60s' already; leave that out (--carry), or give it "
                              "another name", name);
    free(name);
    return status;
}

/* The bound of a node: its worst component's. */
static double bound_of(const struct contraction_log *log, uint32_t field, size_t record)
{
    double worst = 0;
    for (uint32_t c = 0; c < log->component_count; c++)
        if (log->components[c].field == field)
            worst = larger(worst, log->components[c].bounds[record]);
    return worst;
}

/* Its numbers are steps from 0 on; the least is no less than what the field's values are rounded by. */
static struct grid choose_grid(double most, double rounding, double range)
{
    double largest = larger(most, rounding), step = larger(range / STEPS_OF_RANGE, DBL_MIN);
    while (largest > 0 && step > 10 * DBL_MIN && step * MIN_STEPS > 10 * largest)
        step /= 10;
    while (step * MIN_STEPS * 2 < largest)
        step *= 2;
    while (largest > 0 && step > 2 * DBL_MIN && step * MIN_STEPS > largest)
        step /= 2;
    double origin = ceil(rounding / step) * step;
    double last = larger(ceil((most - origin) / step), 0);
    unsigned bits = 1;
    while ((double)((UINT64_C(1) << bits) - 1) < last)
        bits++;
    return (struct grid){bits, origin, step, last};
}

/* No less than it: the value that is stored, up to a tie. */
static double round_up(const struct grid *grid, double bound)
{
    return grid->origin + grid->step * larger(ceil((bound - grid->origin) / grid->step * (1 - TIE)), 0);
}

/* `max` of each level is no less than the largest value that is stored of it, up to a tie: the bounds are what it comes
 * from. */
static void raise_max(struct contraction_log *log, uint32_t source, double origin, const double *values)
{
    double most = origin;
    for (uint32_t m = 0, next = 0; m < log->mark_count; m++) {
        for (; next < log->marks[m].contractions; next++)
            most = larger(most, values[next]);
        for (uint32_t c = 0; c < log->component_count; c++) {
            double *certified = &log->certified[(size_t)m * log->component_count + c];
            if (log->components[c].field == source)
                *certified = larger(*certified, most * log->components[c].scale * (1 - TIE / 2));
        }
    }
}

/* The local bound of `source` becomes the last field. */
static enum tetlod_status add(struct local_bounds *out, struct precision *precision, struct contraction_log *log,
                              uint32_t source,
                              struct tetlod_error *error)
{
    uint32_t f = out->original.field_count;
    char *name = local_bound_name(precision->mesh.fields[source].name);
    double *values = array_new(log->count, sizeof *values), most = 0, range[2];
    point_field_range(&out->original.fields[source], out->original.vertex_count, range);
    if (!name || !values) {
        free(name);
        free(values);
        return tetlodi_fail_nomem(error, "the local bounds", log->count * sizeof *values);
    }
    for (size_t i = 0; i < log->count; i++) {
        values[i] = bound_of(log, source, i);
        most = larger(most, values[i]);
    }
    struct grid grid = choose_grid(most, precision->rounding[source], range[1] - range[0]);
    for (size_t i = 0; i < log->count; i++)
        values[i] = round_up(&grid, values[i]);
    raise_max(log, source, grid.origin, values);
    log->fields[f] = (struct log_field){1, values};
    struct point_field *field = &out->original.fields[f];
    *field = (struct point_field){.name = name, .components = 1, .type = TETLOD_FLOAT64, .values = out->zeros};
    precision->mesh.fields[f] = *field;
    precision->mesh.fields[f].grid = grid;
    precision->rounding[f] = precision->rounding_rms[f] = grid.origin;
    out->original.field_count = precision->mesh.field_count = log->field_count = f + 1;
    return TETLOD_OK;
}

/* Room for one more field for each controlled one. The mesh's fields are copied; the others' rows grow. */
static bool make_room(struct local_bounds *out, const struct tetmesh *original, struct precision *precision,
                      struct contraction_log *log)
{
    size_t room = (size_t)original->field_count + log->component_count;
    struct point_field *own = array_new(room, sizeof *own), *coded = array_resize(precision->mesh.fields, room,
                                                                                  sizeof *coded);
    struct log_field *logged = array_resize(log->fields, room, sizeof *logged);
    double *rounding = array_resize(precision->rounding, room, sizeof *rounding);
    double *rms = array_resize(precision->rounding_rms, room, sizeof *rms);
    out->zeros = array_zero(original->vertex_count, sizeof *out->zeros);
    out->original.fields = own;
    precision->mesh.fields = coded ? coded : precision->mesh.fields;
    log->fields = logged ? logged : log->fields;
    precision->rounding = rounding ? rounding : precision->rounding;
    precision->rounding_rms = rms ? rms : precision->rounding_rms;
    if (own)
        memcpy(own, original->fields, original->field_count * sizeof *own);
    return own && coded && logged && rounding && rms && out->zeros;
}

enum tetlod_status local_bounds_add(struct local_bounds *out, const struct tetmesh *original,
                                    struct precision *precision,
                                    struct contraction_log *log, struct tetlod_error *error)
{
    *out = (struct local_bounds){.first = original->field_count, .original = *original};
    if (!make_room(out, original, precision, log))
        return tetlodi_fail_nomem(error, "the local bounds", original->vertex_count * sizeof *out->zeros);
    for (uint32_t c = 0; c < log->component_count; c++)
        if (!c || log->components[c].field != log->components[c - 1].field)
            TETLOD_TRY(add(out, precision, log, log->components[c].field, error));
    for (uint32_t c = 0; c < log->component_count; c++) {
        free(log->components[c].bounds);
        log->components[c].bounds = NULL;
    }
    return TETLOD_OK;
}

void local_bounds_fini(struct local_bounds *bounds)
{
    for (uint32_t f = bounds->first; f < bounds->original.field_count; f++)
        free(bounds->original.fields[f].name);
    free(bounds->original.fields);
    free(bounds->zeros);
    *bounds = (struct local_bounds){0};
}
