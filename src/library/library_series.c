/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A series of arrays in memory. In: the mesh again and again, with the values of a step. Each step is checked and
 * copied as a mesh of its own; its controlled values go to a temporary file. Out, at the end: the stream that `tetlod
 * build` makes of files with the same steps.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/library/library.h"
#include "src/mesh/displacement.h"
#include "src/pipeline/build_series.h"
#include "src/pipeline/series_spool.h"
#include "src/util/array.h"

struct tetlod_build_series {
    struct tetlod_build_options given;
    struct build_options options;
    struct tetmesh first;           /* the first step */
    struct build_control *controls; /* owned */
    enum tetlod_type *types;        /* owned: [control], as in the first step */
    double *times;                  /* owned */
    size_t step_count, time_capacity;
    struct build_series_cells *cells; /* owned: [first.cell_field_count] */
    struct spool spool, cell_spool;
    bool is_spoilt; /* its options were refused, or a step after some of its values were written */
};

/* A series has the plain certificate alone (build_series.h). */
static enum tetlod_status check_series(const struct tetlod_build_options *options, struct tetlod_error *error)
{
    const char *wrong = options->certify_exact                                  ? "certify_exact"
                        : options->certify_all                                  ? "certify_all"
                        : options->local_bound                                  ? "local_bound"
                        : options->keep_features > 0                            ? "keep_features"
                        : options->position_bits || options->position_error > 0 ? "rounded positions"
                        : options->field_bits || options->field_error > 0       ? "rounded fields"
                                                                                : NULL;
    return wrong ? tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "a series cannot be built with %s", wrong) : TETLOD_OK;
}

enum tetlod_status tetlod_build_series_new(struct tetlod_build_series **out, const struct tetlod_build_options *options,
                                           struct tetlod_error *error)
{
    struct tetlod_build_series *series = array_zero(1, sizeof *series);
    *out = series;
    if (!series)
        return tetlodi_fail_nomem(error, "the series", sizeof *series);
    enum tetlod_status status = library_options(options, &series->given, &series->options, error);
    series->options.domain_error = 0; // a step's error is then one at the same position
    if (status == TETLOD_OK)
        status = check_series(&series->given, error);
    if (status == TETLOD_OK)
        status = spool_open(&series->spool, error);
    if (status == TETLOD_OK)
        status = spool_open(&series->cell_spool, error);
    series->is_spoilt = status != TETLOD_OK;
    return status;
}

void tetlod_build_series_free(struct tetlod_build_series *series)
{
    if (!series)
        return;
    spool_close(&series->spool);
    spool_close(&series->cell_spool);
    tetmesh_fini(&series->first);
    free(series->controls);
    free(series->types);
    free(series->cells);
    free(series->times);
    free(series);
}

/* ---- steps */

static enum tetlod_status put(struct tetlod_build_series *series, struct tetmesh *mesh, struct tetlod_error *error)
{
    enum tetlod_status status = series_spool_put(&series->spool, mesh, &series->first, series->options.controls,
                                                 series->options.control_count, series->types, error);
    if (status == TETLOD_MORE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "a field of float32 has become one of float64");
    return status == TETLOD_OK
               ? series_spool_put_cells(&series->cell_spool, mesh, &series->first, series->cells, error)
               : status;
}

/* The first step decides which fields are controlled, and their types. */
static enum tetlod_status take_first(struct tetlod_build_series *series, struct tetmesh *mesh,
                                     struct tetlod_error *error)
{
    series->first = *mesh;
    *mesh = (struct tetmesh){0};
    TETLOD_TRY(library_choose(&series->first, &series->given, true, &series->options, &series->controls, error));
    uint32_t count = series->options.control_count;
    series->types = array_new(count, sizeof *series->types);
    series->cells = array_zero(series->first.cell_field_count, sizeof *series->cells);
    if (!series->types || !series->cells)
        return tetlodi_fail_nomem(error, "the fields' types", count * sizeof *series->types);
    series_spool_cells(&series->first, series->cells);
    for (uint32_t c = 0; c < count; c++)
        series->types[c] = series->first.fields[series->controls[c].field].type;
    return put(series, &series->first, error);
}

static enum tetlod_status take_next(struct tetlod_build_series *series, struct tetmesh *mesh,
                                    struct tetlod_error *error)
{
    const char *obstacle = displacement_obstacle(mesh, &series->first);
    if (obstacle || displacement_moves(mesh, &series->first))
        return tetlodi_fail(error, TETLOD_ERR_MESH, "%s; the mesh of a series stays as it is",
                            obstacle ? obstacle : "points have moved");
    return put(series, mesh, error);
}

static enum tetlod_status check_time(const struct tetlod_build_series *series, double time, struct tetlod_error *error)
{
    if (!isfinite(time))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "its time is not a finite number");
    if (series->step_count && !(time > series->times[series->step_count - 1]))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "its time %.9g is not behind that of the step before, %.9g",
                            time, series->times[series->step_count - 1]);
    if (series->step_count >= MAX_SERIES_STEPS)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "a series has at most %d steps", MAX_SERIES_STEPS);
    return TETLOD_OK;
}

enum tetlod_status tetlod_build_series_add(struct tetlod_build_series *series, const struct tetlod_build_mesh *mesh,
                                           double time, struct tetlod_error *error)
{
    struct tetmesh copy = {0};
    struct tetlod_error inner = {0};
    size_t count = series->step_count;
    enum tetlod_status status = check_time(series, time, &inner);
    if (status == TETLOD_OK && series->is_spoilt)
        status = tetlodi_fail(&inner, TETLOD_ERR_ARGUMENT, "the series was refused before; begin a new one");
    if (status == TETLOD_OK)
        status = library_copy_mesh(&copy, mesh, &inner);
    if (status == TETLOD_OK &&
        !ARRAY_RESERVE(series->times, series->time_capacity, count + 1))
        status = tetlodi_fail_nomem(&inner, "the times", count * sizeof *series->times);
    if (status == TETLOD_OK) {
        status = count ? take_next(series, &copy, &inner) : take_first(series, &copy, &inner);
        series->is_spoilt = status != TETLOD_OK; // some of its values may be there
    }
    tetmesh_fini(&copy);
    if (status != TETLOD_OK)
        return tetlodi_fail(error, status, "step %zu: %s", count, inner.message);
    series->times[series->step_count++] = time;
    return TETLOD_OK;
}

enum tetlod_status tetlod_build_series_finish(struct tetlod_build_series *series,
                                              enum tetlod_status (*write)(void *opaque, const void *bytes, size_t size),
                                              void *opaque, struct tetlod_error *error)
{
    struct build_series input = {
        .times = series->times, .types = series->types, .step_count = (uint32_t)series->step_count,
        .cells = series->cells, .cell_count = series->first.cell_field_count};
    struct build_options options = series->options;
    if (!series->step_count || series->is_spoilt)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            series->is_spoilt ? "the series, or a step of it, was refused" : "a series needs a step");
    input.bands = build_series_bands(&input.band_count);
    TETLOD_TRY(spool_source(&series->spool, &input.values, error));
    TETLOD_TRY(spool_source(&series->cell_spool, &input.cell_values, error));
    options.series = &input;
    return library_build(&series->first, &series->given, options, &(const struct tetlodi_sink){write, opaque}, error);
}
