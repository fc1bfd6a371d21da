/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/local_bound.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/writer.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* The largest bound has this many steps of its field's grid at least: twice as many at most. */
enum { STEP_BITS = 15 };

char *local_bound_name(const char *field)
{
    size_t size = strlen(field) + sizeof BOUND_SUFFIX;
    char *name = array_new(size, 1);
    if (name)
        snprintf(name, size, "%s%s", field, BOUND_SUFFIX);
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
                              "--local-bound: it has a field '%.60s' already; leave that out (--carry), or give it another name", name);
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

/* Its numbers are steps from 0 on, exactly; the least is no less than what the field's values are rounded by. */
static struct grid choose_grid(double most, double rounding)
{
    int exponent;
    frexp(larger(most, rounding), &exponent);
    double step = larger(ldexp(1, exponent - 1 - STEP_BITS), DBL_MIN), origin = ceil(rounding / step) * step;
    double last = larger(ceil((most - origin) / step), 0);
    unsigned bits = 1;
    while ((double)((UINT64_C(1) << bits) - 1) < last)
        bits++;
    return (struct grid){bits, origin, step, last};
}

/* float32, where that has all of the grid's numbers. */
static enum tetlod_type type_of(const struct grid *grid, enum tetlod_type source)
{
    bool narrow = grid->step >= FLT_MIN && grid->origin + grid->step * grid->most <= FLT_MAX;
    return source == TETLOD_FLOAT32 && narrow ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
}

/* The nodes' bounds, rounded up. */
static void round_up(const struct grid *grid, double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        values[i] = grid->origin + grid->step * larger(ceil((values[i] - grid->origin) / grid->step), 0);
}

/* The local bound of `source` becomes the last field. */
static enum tetlod_status add(struct local_bounds *out, struct precision *precision, struct contraction_log *log, uint32_t source,
                              struct tetlod_error *error)
{
    uint32_t f = out->original.field_count;
    char *name = local_bound_name(precision->mesh.fields[source].name);
    double *values = array_new(log->count, sizeof *values), most = 0;
    if (!name || !values) {
        free(name);
        free(values);
        return tetlodi_fail_nomem(error, "the local bounds", log->count * sizeof *values);
    }
    for (size_t i = 0; i < log->count; i++) {
        values[i] = bound_of(log, source, i);
        most = larger(most, values[i]);
    }
    struct grid grid = choose_grid(most, precision->rounding[source]);
    round_up(&grid, values, log->count);
    log->fields[f] = (struct log_field){1, values};
    struct point_field *field = &out->original.fields[f];
    *field = (struct point_field){.name = name, .components = 1, .type = type_of(&grid, precision->mesh.fields[source].type), .values = out->zeros};
    precision->mesh.fields[f] = *field;
    precision->mesh.fields[f].grid = grid;
    precision->rounding[f] = precision->rounding_rms[f] = grid.origin;
    out->original.field_count = precision->mesh.field_count = log->field_count = f + 1;
    return TETLOD_OK;
}

/* Room for one more field for each controlled one. The mesh's fields are copied; the others' rows grow. */
static bool make_room(struct local_bounds *out, const struct tetmesh *original, struct precision *precision, struct contraction_log *log)
{
    size_t room = (size_t)original->field_count + log->component_count;
    struct point_field *own = array_new(room, sizeof *own), *coded = array_resize(precision->mesh.fields, room, sizeof *coded);
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

enum tetlod_status local_bounds_add(struct local_bounds *out, const struct tetmesh *original, struct precision *precision,
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
