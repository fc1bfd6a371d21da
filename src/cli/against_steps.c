/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/against_steps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/cli/tolerance.h"
#include "src/measure/measure.h"
#include "src/measure/overlay.h"
#include "src/measure/same.h"
#include "src/mesh/displacement.h"
#include "src/report/level_mesh.h"
#include "src/report/series_json.h"
#include "src/util/array.h"

/* A band: a cursor that stays at its level, so that a step is one frame. */
struct band_reader {
    struct tetlod_series *series;
    struct tetlod_cursor *cursor;
};

struct steps_check {
    struct tetlod_file *file;
    const struct steps_comparison *comparison;
    struct band_reader *bands;
    uint32_t band_count, field_count, step_count;
    bool own_ranges;  /* bands are fractions of these */
    uint32_t *fields; /* [field] of the input's mesh, then of the level's: in order */
    double *floors, *found;
    struct tetlod_error *error;
};

static void close_bands(struct steps_check *check)
{
    for (uint32_t b = 0; b < check->band_count && check->bands; b++) {
        tetlod_cursor_free(check->bands[b].cursor);
        tetlod_series_free(check->bands[b].series);
    }
    free(check->bands);
    free(check->fields);
    free(check->floors);
    free(check->found);
}

static enum tetlod_status open_bands(struct steps_check *check)
{
    static const uint32_t none[1] = {0};
    struct tetlod_series *first;
    TETLOD_TRY(tetlod_series_new(&first, check->file, check->error));
    const struct tetlod_series_info *info = tetlod_series_info(first);
    uint32_t bands = info->band_count;
    check->field_count = info->field_count;
    check->step_count = info->step_count;
    check->own_ranges = series_own_ranges(tetlod_info(check->file));
    tetlod_series_free(first);
    check->bands = array_zero(bands, sizeof *check->bands);
    check->fields = array_zero(2 * (size_t)check->field_count, sizeof *check->fields);
    check->floors = array_zero(check->field_count, sizeof *check->floors);
    check->found = array_zero(check->field_count, sizeof *check->found);
    if (!check->bands || !check->fields || !check->floors || !check->found)
        return tetlodi_fail_nomem(check->error, "the bands", bands * sizeof *check->bands);
    check->band_count = bands;
    for (uint32_t f = 0; f < check->field_count; f++)
        check->fields[check->field_count + f] = f;
    for (uint32_t b = 0; b < bands; b++) {
        TETLOD_TRY(tetlod_series_new(&check->bands[b].series, check->file, check->error));
        TETLOD_TRY(tetlod_cursor_new(&check->bands[b].cursor, check->file, none, 0, check->error));
    }
    return TETLOD_OK;
}

static bool points_move(const struct steps_check *check)
{
    return tetlod_series_info(check->bands[0].series)->displacement != TETLOD_NONE;
}

/* Tetrahedra that the step which the band is at turns over. */
static enum tetlod_status count_turned(const struct steps_check *check, const struct band_reader *band, uint64_t *io_most)
{
    struct tetlod_mesh mesh;
    uint64_t turned;
    tetlod_cursor_mesh(band->cursor, &mesh);
    double *moved = array_new(mesh.vertices, 3 * sizeof *moved);
    if (!moved)
        return tetlodi_fail_nomem(check->error, "the points of a step", (uint64_t)mesh.vertices * 24);
    memcpy(moved, mesh.positions, mesh.vertices * 3 * sizeof *moved);
    enum tetlod_status status = tetlod_step_move(band->series, moved, check->error);
    turned = status == TETLOD_OK ? displacement_turned(mesh.positions, moved, mesh.corners, mesh.tets) : 0;
    *io_most = turned > *io_most ? turned : *io_most;
    free(moved);
    return status;
}

enum tetlod_status steps_decode(struct tetlod_file *file, struct steps_found *found, struct tetlod_error *error)
{
    struct steps_check check = {.file = file, .error = error};
    enum tetlod_status status = open_bands(&check);
    *found = (struct steps_found){.steps = check.step_count};
    found->move = status == TETLOD_OK && points_move(&check);
    for (uint32_t b = 0; b < check.band_count && status == TETLOD_OK; b++)
        for (uint32_t s = 0; s < check.step_count && status == TETLOD_OK; s++) {
            status = tetlod_seek_step(check.bands[b].series, check.bands[b].cursor, b, s, error);
            if (status == TETLOD_OK && found->move)
                status = count_turned(&check, &check.bands[b], &found->turned);
        }
    close_bands(&check);
    return status;
}

/* ---- one step */

static enum tetlod_status find_fields(struct steps_check *check, struct tetmesh *input)
{
    const struct tetlod_info *info = tetlod_info(check->file);
    const struct tetlod_series_info *steps = tetlod_series_info(check->bands[0].series);
    for (uint32_t f = 0; f < check->field_count; f++) {
        struct build_control control;
        TETLOD_TRY(build_control_parse(input, info->fields[steps->fields[f]].name, &control, check->error));
        check->fields[f] = control.field;
        if (input->fields[control.field].components != info->fields[steps->fields[f]].components)
            return tetlodi_fail(check->error, TETLOD_ERR_MISMATCH, "field '%.60s' has another number of components",
                                info->fields[steps->fields[f]].name);
    }
    return TETLOD_OK;
}

static enum tetlod_status too_large(const struct steps_check *check, uint32_t b, uint32_t step, uint32_t f, const char *what, double found)
{
    const struct band_reader *band = &check->bands[b];
    const struct tetlod_series_info *steps = tetlod_series_info(band->series);
    double width = steps->ranges[f][1] - steps->ranges[f][0];
    return tetlodi_fail(check->error, TETLOD_ERR_MISMATCH, "step %u in the band of %g: %s of '%.60s' is %.9g of the range, the stream says %.9g",
                        step, steps->bands[b].error, what, tetlod_info(check->file)->fields[steps->fields[f]].name,
                        width > 0 ? found / width : found, tetlod_step_error(band->series, f, b, step));
}

/* The range that a band counts a step's error in: the step's own, if it has one, or that over all steps. */
static void counted_range(const struct steps_check *check, const struct tetmesh *input, uint32_t field, uint32_t f, double out[2])
{
    const struct tetlod_series_info *steps = tetlod_series_info(check->bands[0].series);
    point_field_range(&input->fields[field], input->vertex_count, out);
    if (!check->own_ranges || f == steps->displacement || !(out[1] > out[0]))
        memcpy(out, steps->ranges[f], 2 * sizeof *out);
}

/* The largest difference that the stream allows. */
static double promised(const struct steps_check *check, const struct tetmesh *input, uint32_t b, uint32_t step, uint32_t f)
{
    const struct tetlod_series_info *steps = tetlod_series_info(check->bands[b].series);
    double range[2];
    counted_range(check, input, check->fields[f], f, range);
    return fmin(largest_difference(tetlod_step_error(check->bands[b].series, f, b, step), steps->ranges[f]),
                largest_difference(steps->bands[b].error, range));
}

static enum tetlod_status read_band(struct steps_check *check, uint32_t b, uint32_t step, struct tetmesh *out)
{
    const struct band_reader *band = &check->bands[b];
    TETLOD_TRY(tetlod_seek_step(band->series, band->cursor, b, step, check->error));
    TETLOD_TRY(level_mesh_copy(tetlod_info(check->file), band->cursor, out, check->error));
    return level_mesh_step(tetlod_info(check->file), band->series, out, check->error);
}

/* A step in a band against the input's. */
static enum tetlod_status compare_band(struct steps_check *check, const struct tetmesh *input, const struct measure *measure, uint32_t b,
                                       uint32_t step, struct tetmesh *mesh, struct measured *measured)
{
    const struct band_reader *band = &check->bands[b];
    const struct tetlod_series_info *steps = tetlod_series_info(band->series);
    struct overlay_report report;
    struct overlay_options options = {.threads = check->comparison->threads, .floors = check->floors};
    double domain;
    TETLOD_TRY(read_band(check, b, step, mesh));
    if (!(steps->bands[b].error > 0))
        return mesh_same(input, mesh, check->error);
    TETLOD_TRY(measure_mesh(measure, mesh, NULL, check->comparison->threads, measured, &domain, check->error));
    for (uint32_t f = 0; f < check->field_count; f++) {
        check->floors[f] = promised(check, input, b, step, f);
        if (measured[f].sampled > check->floors[f])
            return too_large(check, b, step, f, "the error at samples", measured[f].sampled);
    }
    TETLOD_TRY(overlay_max(input, check->fields, mesh, check->fields + check->field_count, check->field_count, &options, check->found, &report, check->error));
    for (uint32_t f = 0; f < check->field_count; f++)
        if (check->found[f] > check->floors[f])
            return too_large(check, b, step, f, "the exact maximum", check->found[f]);
    return TETLOD_OK;
}

static enum tetlod_status compare_step(struct steps_check *check, struct tetmesh *input, uint32_t step)
{
    struct measure *measure = NULL;
    struct measured *measured = array_new(check->field_count, sizeof *measured);
    enum tetlod_status status = measured ? TETLOD_OK : tetlodi_fail_nomem(check->error, "a step", check->field_count * sizeof *measured);
    if (status == TETLOD_OK)
        status = find_fields(check, input);
    if (status == TETLOD_OK)
        status = measure_new(&measure, input, check->fields, check->field_count, check->comparison->threads, check->error);
    for (uint32_t b = 0; b < check->band_count && status == TETLOD_OK; b++) {
        struct tetmesh mesh = {0};
        status = compare_band(check, input, measure, b, step, &mesh, measured);
        tetmesh_fini(&mesh);
    }
    measure_free(measure);
    free(measured);
    return status;
}

static enum tetlod_status read_as_it_is(const struct steps_check *check, uint32_t step, struct tetmesh *out)
{
    const struct steps_comparison *comparison = check->comparison;
    struct io_report report;
    return series_input_read(comparison->input, series_input_number(comparison->input, step), comparison->reading, out, &report, check->error);
}

/* A step's mesh, on the points of the first one if they move. */
static enum tetlod_status read_step(const struct steps_check *check, uint32_t step, const struct tetmesh *first, struct tetmesh *out)
{
    uint64_t rounded = 0;
    TETLOD_TRY(read_as_it_is(check, step, out));
    if (!points_move(check))
        return TETLOD_OK;
    const char *obstacle = displacement_obstacle(out, first);
    if (obstacle)
        return tetlodi_fail(check->error, TETLOD_ERR_MISMATCH, "step %u: %s", step, obstacle);
    return displacement_take(out, first, &rounded, check->error);
}

enum tetlod_status steps_against(struct tetlod_file *file, const struct steps_comparison *comparison, struct tetlod_error *error)
{
    struct steps_check check = {.file = file, .comparison = comparison, .error = error};
    struct tetmesh first = {0};
    enum tetlod_status status = open_bands(&check);
    if (status == TETLOD_OK && points_move(&check))
        status = read_as_it_is(&check, 0, &first);
    for (uint32_t s = 0; s < check.step_count && status == TETLOD_OK; s++) {
        struct tetmesh input = {0};
        struct tetlod_error inner = {0};
        status = read_step(&check, s, &first, &input);
        if (status == TETLOD_OK) {
            check.error = &inner;
            status = compare_step(&check, &input, s);
            check.error = error;
            if (status != TETLOD_OK)
                tetlodi_fail(error, status, "%.230s", inner.message);
        }
        tetmesh_fini(&input);
        comparison->watch.progress(comparison->watch.opaque, (s + 1.0) / check.step_count);
    }
    tetmesh_fini(&first);
    close_bands(&check);
    return status;
}

/* ---- measuring: the steps of a band are the fields of one mesh, for its geometry is the same at all of them */

enum { BATCH_BYTES = 1 << 28 }; /* of exact values held at once */

/* The steps at hand, and the exact one of their bands. */
struct steps_batch {
    uint32_t first, count, field;
    unsigned threads;
    struct tetmesh exact; /* [step of the batch] its fields */
};

static enum tetlod_status read_batch(const struct steps_check *check, const struct steps_batch *batch, uint32_t b, struct tetmesh *out)
{
    const struct band_reader *band = &check->bands[b];
    const struct tetlod_info *info = tetlod_info(check->file);
    const struct tetlod_field *field = &info->fields[tetlod_series_info(band->series)->fields[batch->field]];
    for (uint32_t i = 0; i < batch->count; i++) {
        TETLOD_TRY(tetlod_seek_step(band->series, band->cursor, b, batch->first + i, check->error));
        if (i == 0)
            TETLOD_TRY(level_mesh_copy(info, band->cursor, out, check->error));
        TETLOD_TRY(tetmesh_add_field(out, field->name, field->components, field->type, check->error));
        memcpy(out->fields[i].values, tetlod_step_values(band->series, batch->field),
               (size_t)out->vertex_count * field->components * sizeof(double));
    }
    return TETLOD_OK;
}

static enum tetlod_status measure_band(const struct steps_check *check, const struct steps_batch *batch, const struct measure *measure,
                                       uint32_t b, struct measured *measured, struct steps_errors *out)
{
    struct tetmesh mesh = {0};
    double domain, range[2];
    enum tetlod_status status = read_batch(check, batch, b, &mesh);
    if (status == TETLOD_OK)
        status = measure_mesh(measure, &mesh, NULL, batch->threads, measured, &domain, check->error);
    for (uint32_t i = 0; i < batch->count && status == TETLOD_OK; i++) {
        size_t at = (size_t)b * check->step_count + batch->first + i;
        counted_range(check, &batch->exact, i, batch->field, range);
        double width = range[1] - range[0];
        out->sampled[at] = width > 0 ? measured[i].sampled / width : 0;
        out->rms[at] = width > 0 ? measured[i].rms / width : 0;
    }
    tetmesh_fini(&mesh);
    return status;
}

static enum tetlod_status measure_batch(const struct steps_check *check, struct steps_batch *batch, const struct steps_watch *watch,
                                        struct steps_errors *out)
{
    uint32_t bands = check->band_count - 1; // the last one is exact
    struct measure *measure = NULL;
    struct measured *measured = array_new(batch->count, sizeof *measured);
    enum tetlod_status status = measured ? TETLOD_OK : tetlodi_fail_nomem(check->error, "a step", batch->count * sizeof *measured);
    if (status == TETLOD_OK)
        status = read_batch(check, batch, bands, &batch->exact);
    if (status == TETLOD_OK)
        status = measure_new(&measure, &batch->exact, NULL, batch->count, batch->threads, check->error);
    for (uint32_t b = 0; b < bands && status == TETLOD_OK; b++) {
        status = measure_band(check, batch, measure, b, measured, out);
        watch->progress(watch->opaque, (batch->first + batch->count * (b + 1.0) / bands) / check->step_count);
    }
    measure_free(measure);
    tetmesh_fini(&batch->exact);
    free(measured);
    return status;
}

/* Steps of which the exact values of a field fit. */
static uint32_t batch_steps(const struct steps_check *check, uint32_t field)
{
    const struct tetlod_info *info = tetlod_info(check->file);
    uint32_t components = info->fields[tetlod_series_info(check->bands[0].series)->fields[field]].components;
    uint64_t fit = BATCH_BYTES / (8 * (uint64_t)components * (info->vertices ? info->vertices : 1));
    return fit < 1 ? 1 : fit < check->step_count ? (uint32_t)fit : check->step_count;
}

enum tetlod_status steps_measure(struct tetlod_file *file, uint32_t field, unsigned threads, const struct steps_watch *watch,
                                 struct steps_errors *out, struct tetlod_error *error)
{
    struct steps_check check = {.file = file, .error = error};
    enum tetlod_status status = open_bands(&check);
    size_t count = (size_t)check.band_count * check.step_count;
    *out = (struct steps_errors){0};
    if (status == TETLOD_OK) {
        *out = (struct steps_errors){array_new(count, sizeof(double)), array_new(count, sizeof(double))};
        if (!out->sampled || !out->rms)
            status = tetlodi_fail_nomem(error, "the errors of the steps", 2 * count * sizeof(double));
    }
    uint32_t most = status == TETLOD_OK ? batch_steps(&check, field) : 1;
    for (uint32_t s = 0; s < check.step_count && status == TETLOD_OK; s += most) {
        struct steps_batch batch = {s, check.step_count - s < most ? check.step_count - s : most, field, threads, {0}};
        status = measure_batch(&check, &batch, watch, out);
    }
    close_bands(&check);
    return status;
}
