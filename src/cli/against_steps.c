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
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/stream/metadata.h"
#include "src/stream/level_mesh.h"
#include "src/pipeline/build.h"
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
    bool has_exact;   /* the last band is */
    uint32_t *fields; /* [field] of the input's mesh */
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
    check->own_ranges = metadata_own_ranges(tetlod_info(check->file));
    check->has_exact = !(info->bands[bands - 1].error > 0);
    tetlod_series_free(first);
    check->bands = array_zero(bands, sizeof *check->bands);
    check->fields = array_zero(check->field_count, sizeof *check->fields);
    if (!check->bands || !check->fields)
        return tetlodi_fail_nomem(check->error, "the bands", bands * sizeof *check->bands);
    check->band_count = bands;
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
static enum tetlod_status count_turned(const struct steps_check *check, const struct band_reader *band,
                                       uint64_t *io_most)
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

/* ---- decoding */

static enum tetlod_status begin_ranges(const struct steps_check *check, struct steps_found *found)
{
    const struct tetlod_info *info = tetlod_info(check->file);
    const struct tetlod_series_info *steps = tetlod_series_info(check->bands[0].series);
    found->ranges = array_zero(steps->field_count, sizeof *found->ranges);
    for (uint32_t f = 0; f < steps->field_count && found->ranges; f++) {
        const double *declared = steps->ranges[f];
        double room = steps->bands[steps->band_count - 1].error * (declared[1] - declared[0]) * (1 + TIE);
        found->ranges[f] = (struct steps_range){.of_group = f == steps->displacement,
                                                .declared = {declared[0], declared[1]},
                                                .found = {INFINITY, -INFINITY}, .room = room};
        found->ranges[f].name = strdup(info->fields[steps->fields[f]].name);
        found->range_count += found->ranges[f].name != NULL;
    }
    return found->range_count == steps->field_count
               ? TETLOD_OK
               : tetlodi_fail_nomem(check->error, "the ranges", steps->field_count * sizeof *found->ranges);
}

/* Of the step that the last band, which is the nearest to the input, is at. */
static void widen_ranges(const struct steps_check *check, const struct steps_found *found)
{
    const struct band_reader *band = &check->bands[check->band_count - 1];
    const struct tetlod_series_info *steps = tetlod_series_info(band->series);
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(band->cursor, &mesh);
    for (uint32_t f = 0; f < found->range_count; f++) {
        const double *values = tetlod_step_values(band->series, f);
        size_t count = (size_t)mesh.vertices * tetlod_info(check->file)->fields[steps->fields[f]].components;
        double *range = found->ranges[f].found;
        for (size_t i = 0; i < count; i++) {
            range[0] = values[i] < range[0] ? values[i] : range[0];
            range[1] = values[i] > range[1] ? values[i] : range[1];
        }
    }
}

static enum tetlod_status decode_band(const struct steps_check *check, uint32_t b, struct steps_found *found)
{
    const struct band_reader *band = &check->bands[b];
    for (uint32_t s = 0; s < check->step_count; s++) {
        TETLOD_TRY(tetlod_seek_step(band->series, band->cursor, b, s, check->error));
        if (found->move)
            TETLOD_TRY(count_turned(check, band, &found->turned));
        if (b + 1 == check->band_count)
            widen_ranges(check, found);
    }
    return TETLOD_OK;
}

enum tetlod_status steps_decode(struct tetlod_file *file, struct steps_found *found, struct tetlod_error *error)
{
    struct steps_check check = {.file = file, .error = error};
    enum tetlod_status status = open_bands(&check);
    *found = (struct steps_found){.steps = check.step_count};
    found->move = status == TETLOD_OK && points_move(&check);
    const double *times = status == TETLOD_OK ? tetlod_series_info(check.bands[0].series)->times : NULL;
    for (uint32_t s = 1; s < check.step_count && status == TETLOD_OK; s++)
        if (!(times[s] > times[s - 1]))
            status = tetlodi_fail(error, TETLOD_ERR_STREAM, "steps %u and %u have the same time, %.9g", s - 1, s,
                                  times[s]);
    if (status == TETLOD_OK)
        status = begin_ranges(&check, found);
    for (uint32_t b = 0; b < check.band_count && status == TETLOD_OK; b++)
        status = decode_band(&check, b, found);
    close_bands(&check);
    return status;
}

void steps_found_fini(struct steps_found *found)
{
    for (uint32_t f = 0; f < found->range_count; f++)
        free(found->ranges[f].name);
    free(found->ranges);
    *found = (struct steps_found){0};
}

enum tetlod_status steps_found_add(struct steps_found *all, const struct steps_found *group, struct tetlod_error *error)
{
    all->steps += group->steps;
    all->move |= group->move;
    all->turned = group->turned > all->turned ? group->turned : all->turned;
    for (uint32_t i = 0; i < all->range_count * group->range_count; i++) {
        struct steps_range *to = &all->ranges[i / group->range_count];
        const struct steps_range *from = &group->ranges[i % group->range_count];
        if (to->of_group || from->of_group || strcmp(to->name, from->name) != 0)
            continue;
        if (to->declared[0] != from->declared[0] || to->declared[1] != from->declared[1])
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "%.60s is said to be in %.9g .. %.9g here, in the first group in %.9g .. %.9g",
                                to->name, from->declared[0], from->declared[1], to->declared[0], to->declared[1]);
        to->found[0] = fmin(to->found[0], from->found[0]);
        to->found[1] = fmax(to->found[1], from->found[1]);
        to->room = fmax(to->room, from->room);
    }
    return TETLOD_OK;
}

enum tetlod_status steps_check_ranges(const struct steps_found *found, bool of_groups, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < found->range_count; f++) {
        const struct steps_range *range = &found->ranges[f];
        if (range->of_group == of_groups &&
            !(fabs(range->declared[0] - range->found[0]) <= range->room &&
              fabs(range->declared[1] - range->found[1]) <= range->room))
            return tetlodi_fail(error, TETLOD_ERR_STREAM,
                                "the steps' table says that %.60s is in %.9g .. %.9g, the steps have %.9g .. %.9g",
                                range->name, range->declared[0], range->declared[1], range->found[0], range->found[1]);
    }
    return TETLOD_OK;
}

/* ---- several steps at once: as the fields of one mesh, for the geometry of a band is the same at all steps */

enum { BATCH_BYTES = 1 << 28, BATCH_STEPS = 32 }; /* of exact values held at once, at most */

/* The current steps: fields `field` to field + field_count of the series. */
struct steps_batch {
    uint32_t first, count, field, field_count;
    unsigned threads;
    struct tetmesh exact; /* its fields are [step of the batch][field] */
};

/* Steps of which the exact values fit. */
static uint32_t batch_steps(const struct steps_check *check, const struct steps_batch *batch)
{
    const struct tetlod_info *info = tetlod_info(check->file);
    uint64_t bytes = 0;
    for (uint32_t f = 0; f < batch->field_count; f++)
        bytes += 8 * (uint64_t)info->vertices *
                 info->fields[tetlod_series_info(check->bands[0].series)->fields[batch->field + f]].components;
    uint64_t fit = bytes ? BATCH_BYTES / bytes : BATCH_STEPS;
    return fit < 1 ? 1 : fit < BATCH_STEPS ? (uint32_t)fit : BATCH_STEPS;
}

/* The batch's steps in a band. */
static enum tetlod_status read_batch(const struct steps_check *check, const struct steps_batch *batch, uint32_t b,
                                     struct tetmesh *out)
{
    const struct band_reader *band = &check->bands[b];
    const struct tetlod_info *info = tetlod_info(check->file);
    for (uint32_t i = 0; i < batch->count; i++) {
        TETLOD_TRY(tetlod_seek_step(band->series, band->cursor, b, batch->first + i, check->error));
        if (i == 0)
            TETLOD_TRY(level_mesh_copy(info, band->cursor, out, check->error));
        for (uint32_t f = batch->field; f < batch->field + batch->field_count; f++) {
            const struct tetlod_series_info *steps = tetlod_series_info(band->series);
            const struct tetlod_field *field = &info->fields[steps->fields[f]];
            TETLOD_TRY(tetmesh_add_field(out, field->name, field->components, steps->types[f], check->error));
            memcpy(out->fields[out->field_count - 1].values, tetlod_step_values(band->series, f),
                   (size_t)out->vertex_count * field->components * sizeof(double));
        }
    }
    return TETLOD_OK;
}

static void show_batch(const struct steps_check *check, const struct steps_batch *batch,
                       const struct steps_watch *watch, uint32_t b)
{
    watch->progress(watch->opaque, (batch->first + batch->count * (b + 1.0) / check->band_count) / check->step_count);
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
        // steps of both types are stored in the wider one, which holds all their values
        if (steps->types[f] == TETLOD_FLOAT64)
            input->fields[control.field].type = TETLOD_FLOAT64;
    }
    return TETLOD_OK;
}

static enum tetlod_status too_large(const struct steps_check *check, uint32_t b, uint32_t step, uint32_t f,
                                    const char *what, double found)
{
    const struct band_reader *band = &check->bands[b];
    const struct tetlod_series_info *steps = tetlod_series_info(band->series);
    double width = steps->ranges[f][1] - steps->ranges[f][0];
    return tetlodi_fail(check->error, TETLOD_ERR_MISMATCH,
                        "step %u in the band of %g: %s of '%.60s' is %.9g of the range, the stream says %.9g",
                        step, steps->bands[b].error, what, tetlod_info(check->file)->fields[steps->fields[f]].name,
                        width > 0 ? found / width : found, tetlod_step_error(band->series, f, b, step));
}

/* The range that a band counts a step's error in: the step's own, if it has one, or that over all steps. */
static void counted_range(const struct steps_check *check, const struct tetmesh *input, uint32_t field, uint32_t f,
                          double out[2])
{
    const struct tetlod_series_info *steps = tetlod_series_info(check->bands[0].series);
    point_field_range(&input->fields[field], input->vertex_count, out);
    if (!check->own_ranges || f == steps->displacement || !(out[1] > out[0]))
        memcpy(out, steps->ranges[f], 2 * sizeof *out);
}

/* The largest difference that the stream allows, of field `at` of the input. */
static double promised(const struct steps_check *check, const struct tetmesh *input, uint32_t at, uint32_t b,
                       uint32_t step, uint32_t f)
{
    const struct tetlod_series_info *steps = tetlod_series_info(check->bands[b].series);
    double range[2];
    counted_range(check, input, at, f, range);
    return fmin(largest_difference(tetlod_step_error(check->bands[b].series, f, b, step), steps->ranges[f]),
                largest_difference(steps->bands[b].error, range));
}

static bool is_exact(const struct steps_check *check, uint32_t b)
{
    return !(tetlod_series_info(check->bands[b].series)->bands[b].error > 0);
}

static enum tetlod_status compare_exact(const struct steps_check *check, const struct tetmesh *input, uint32_t step)
{
    enum tetlod_status status = TETLOD_OK;
    for (uint32_t b = 0; b < check->band_count && status == TETLOD_OK; b++) {
        const struct band_reader *band = &check->bands[b];
        struct tetmesh mesh = {0};
        struct tetlod_error inner = {0};
        if (!is_exact(check, b))
            continue;
        TETLOD_TRY(tetlod_seek_step(band->series, band->cursor, b, step, check->error));
        TETLOD_TRY(level_mesh_copy(tetlod_info(check->file), band->cursor, &mesh, check->error));
        status = level_mesh_step(tetlod_info(check->file), band->series, &mesh, check->error);
        if (status == TETLOD_OK)
            status = level_mesh_step_cells(check->file, band->series, step, TETLOD_NONE, &mesh, check->error);
        if (status == TETLOD_OK)
            status = mesh_same(input, &mesh, &inner) == TETLOD_OK
                         ? TETLOD_OK
                         : tetlodi_fail(check->error, inner.status, "step %u: %s", step, inner.message);
        tetmesh_fini(&mesh);
    }
    return status;
}

/* What is known of a batch's exact mesh where it is the stream's own, whose numbers a band's level shares: bodies, and
 * what has a promise. */
struct exact_mesh {
    uint32_t *bodies;            /* [vertex] */
    struct sheets sheets;
    uint8_t *looked;             /* [tet] promised, and not in the level as it is */
    uint8_t *usable, *wanted;    /* [tet of the level] */
};

static void release_exact(struct exact_mesh *exact)
{
    void *const owned[] = {exact->bodies, exact->looked, exact->usable, exact->wanted};
    sheets_fini(&exact->sheets);
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

static enum tetlod_status prepare_exact(const struct tetmesh *mesh, struct exact_mesh *out, struct tetlod_error *error)
{
    *out = (struct exact_mesh){.bodies = array_new(mesh->vertex_count, sizeof(uint32_t)),
                               .looked = array_new(mesh->tet_count, 1),
                               .usable = array_new(mesh->tet_count, 1),
                               .wanted = array_new(mesh->tet_count, 1)};
    if (!out->bodies || !out->looked || !out->usable || !out->wanted)
        return tetlodi_fail_nomem(error, "the steps", 8 * (uint64_t)mesh->tet_count);
    sheets_bodies(mesh->corners, mesh->tet_count, mesh->vertex_count, out->bodies);
    return sheets_find(&out->sheets, mesh, NULL, error);
}

/* Is tetrahedron t of the level the exact mesh's, with the same corners where they were? */
static bool is_as_it_was(const struct tetmesh *exact, const struct tetmesh *level, size_t t)
{
    const uint32_t *corners = level->corners + 4 * t;
    bool same = memcmp(corners, exact->corners + 4 * t, 4 * sizeof *corners) == 0;
    for (int c = 0; c < 4 && same; c++)
        same = memcmp(level->positions + 3 * (size_t)corners[c], exact->positions + 3 * (size_t)corners[c],
                      3 * sizeof(double)) == 0;
    return same;
}

/* Raises found[] to the differences at a corner. */
static void compare_vertex(const struct tetmesh *exact, const struct tetmesh *level, uint32_t v, double *found)
{
    for (uint32_t i = 0; i < level->field_count; i++) {
        size_t width = level->fields[i].components;
        for (size_t k = width * v; k < width * (v + (size_t)1); k++)
            found[i] = larger(found[i], fabs(level->fields[i].values[k] - exact->fields[i].values[k]));
    }
}

/* In a tetrahedron that is as it was the difference is largest at a corner, and its body needs to look no further
 * there. The others are left to the overlay. */
static void compare_in_place(const struct tetmesh *exact, const struct tetmesh *level, struct exact_mesh *known,
                             double *found)
{
    memcpy(known->looked, known->sheets.promised, exact->tet_count);
    for (size_t t = 0; t < level->tet_count; t++) {
        const uint32_t *corners = level->corners + 4 * t;
        const double *p[4];
        for (int c = 0; c < 4; c++)
            p[c] = level->positions + 3 * (size_t)corners[c];
        known->usable[t] = tet_orientation(p[0], p[1], p[2], p[3]) == sheets_orientation(&known->sheets, t);
        known->wanted[t] = !is_as_it_was(exact, level, t);
        known->looked[t] &= known->wanted[t];
        for (int c = 0; c < 4 && !known->wanted[t] && known->sheets.promised[t]; c++)
            compare_vertex(exact, level, corners[c], found);
    }
}

/* Steps in a band against the exact ones. floors, found: [step of the batch][field], as the fields of the mesh. */
static enum tetlod_status compare_band(const struct steps_check *check, const struct steps_batch *batch,
                                       struct exact_mesh *known, uint32_t b,
                                       struct tetmesh *mesh, double *floors, double *found)
{
    struct overlay_report report;
    struct overlay_options options = {.threads = batch->threads, .floors = floors, .overlaps = true};
    uint32_t count = batch->count * check->field_count, *fields = array_new(count, sizeof *fields);
    enum tetlod_status status = fields ? TETLOD_OK : tetlodi_fail_nomem(check->error, "a band", count * sizeof *fields);
    if (status == TETLOD_OK)
        status = read_batch(check, batch, b, mesh);
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++) {
        fields[i] = i;
        found[i] = 0;
        floors[i] = promised(check, &batch->exact, i, b, batch->first + i / check->field_count, i % check->field_count);
    }
    if (status == TETLOD_OK && check->has_exact) {
        compare_in_place(&batch->exact, mesh, known, found);
        options.bodies[0] = options.bodies[1] = known->bodies;
        options.usable[0] = known->looked;
        options.usable[1] = known->usable;
        options.wanted = known->wanted;
    }
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++)
        if (found[i] > floors[i])
            status = too_large(check, b, batch->first + i / check->field_count, i % check->field_count,
                               "the difference at a vertex", found[i]);
    if (status == TETLOD_OK)
        status = overlay_max(&batch->exact, fields, mesh, fields, count, &options, found, &report, check->error);
    for (uint32_t i = 0; i < count && status == TETLOD_OK; i++)
        if (found[i] > floors[i])
            status = too_large(check, b, batch->first + i / check->field_count, i % check->field_count,
                               "the exact maximum", found[i]);
    free(fields);
    return status;
}

/* Compares the steps of a batch, which is then empty. Where the stream has the exact steps, which were found to be the
 * input's, bands are held against those: they have the stream's numbers. */
static enum tetlod_status compare_batch(const struct steps_check *check, struct steps_batch *batch)
{
    uint32_t count = batch->count * check->field_count;
    struct exact_mesh known = {0};
    double *limits = array_new(count, 2 * sizeof *limits);
    enum tetlod_status status = limits ? TETLOD_OK : tetlodi_fail_nomem(check->error, "a step",
                                                                        count * 2 * sizeof *limits);
    if (status == TETLOD_OK && check->has_exact)
        status = read_batch(check, batch, check->band_count - 1, &batch->exact);
    if (status == TETLOD_OK && check->has_exact)
        status = prepare_exact(&batch->exact, &known, check->error);
    for (uint32_t b = 0; b < check->band_count && status == TETLOD_OK; b++) {
        struct tetmesh mesh = {0};
        if (!is_exact(check, b))
            status = compare_band(check, batch, &known, b, &mesh, limits, limits + count);
        tetmesh_fini(&mesh);
        show_batch(check, batch, &check->comparison->watch, b);
    }
    release_exact(&known);
    free(limits);
    tetmesh_fini(&batch->exact);
    batch->exact = (struct tetmesh){0};
    batch->first += batch->count;
    batch->count = 0;
    return status;
}

static bool same_geometry(const struct tetmesh *a, const struct tetmesh *b)
{
    return a->vertex_count == b->vertex_count && a->tet_count == b->tet_count &&
           memcmp(a->positions, b->positions, (size_t)a->vertex_count * 3 * sizeof(double)) == 0 &&
           memcmp(a->corners, b->corners, (size_t)a->tet_count * 4 * sizeof(uint32_t)) == 0;
}

/* Takes the values of the input, and its geometry if it is the first: of a stream without exact steps. */
static enum tetlod_status batch_take(const struct steps_check *check, struct tetmesh *input, struct steps_batch *batch)
{
    if (batch->count == 0) {
        batch->exact = (struct tetmesh){.vertex_count = input->vertex_count, .tet_count = input->tet_count,
                                        .position_type = input->position_type,
                                        .positions = input->positions, .corners = input->corners};
        input->positions = NULL;
        input->corners = NULL;
    }
    for (uint32_t f = 0; f < check->field_count; f++) {
        const struct point_field *from = &input->fields[check->fields[f]];
        TETLOD_TRY(tetmesh_add_field(&batch->exact, from->name, from->components, from->type, check->error));
        memcpy(batch->exact.fields[batch->exact.field_count - 1].values, from->values,
               (size_t)batch->exact.vertex_count * from->components * sizeof(double));
    }
    batch->count++;
    return TETLOD_OK;
}

/* A step of the input: its exact values are compared at once, those of bands together with those of other steps. */
static enum tetlod_status compare_step(struct steps_check *check, struct tetmesh *input, uint32_t step,
                                       struct steps_batch *batch)
{
    TETLOD_TRY(find_fields(check, input));
    TETLOD_TRY(compare_exact(check, input, step));
    bool full = batch->count == batch_steps(check, batch);
    if (batch->count && (full || (!check->has_exact && !same_geometry(&batch->exact, input))))
        TETLOD_TRY(compare_batch(check, batch));
    if (check->has_exact)
        batch->count++;
    else
        TETLOD_TRY(batch_take(check, input, batch));
    return step + 1 == check->step_count ? compare_batch(check, batch) : TETLOD_OK;
}

/* *out_time is the step's; NaN: the input says none. */
static enum tetlod_status read_as_it_is(const struct steps_check *check, uint32_t step, struct tetmesh *out,
                                        double *out_time)
{
    const struct steps_comparison *comparison = check->comparison;
    struct io_report report;
    TETLOD_TRY(series_input_read(comparison->input, series_input_number(comparison->input, step), comparison->reading,
                                 out, &report, check->error));
    *out_time = report.steps ? report.time : NAN;
    return TETLOD_OK;
}

/* Times are the input's, or all are numbers: where the input's do not rise, at these steps or at those of other
 * topology groups. */
static enum tetlod_status check_times(const struct steps_check *check, const double *times)
{
    const struct steps_comparison *comparison = check->comparison;
    const double *stored = tetlod_series_info(check->bands[0].series)->times;
    bool rise = !comparison->in_groups, numbered = true;
    for (uint32_t s = 0; s < check->step_count; s++) {
        rise &= s == 0 || !(times[s] <= times[s - 1]);
        numbered &= stored[s] == (double)series_input_number(comparison->input, s);
    }
    for (uint32_t s = 0; s < check->step_count && (rise || !numbered); s++)
        if (!isnan(times[s]) && stored[s] != times[s])
            return tetlodi_fail(check->error, TETLOD_ERR_MISMATCH, "step %u: its time is %.17g, the stream says %.17g",
                                s, times[s], stored[s]);
    return TETLOD_OK;
}

/* A step's mesh, on the points of the first one if they move. */
static enum tetlod_status read_step(const struct steps_check *check, uint32_t step, const struct tetmesh *first,
                                    struct tetmesh *out,
                                    double *out_time)
{
    uint64_t rounded = 0;
    TETLOD_TRY(read_as_it_is(check, step, out, out_time));
    if (!points_move(check))
        return TETLOD_OK;
    const char *obstacle = displacement_obstacle(out, first);
    if (obstacle)
        return tetlodi_fail(check->error, TETLOD_ERR_MISMATCH, "step %u: %s", step, obstacle);
    return displacement_take(out, first, &rounded, check->error);
}

enum tetlod_status steps_against(struct tetlod_file *file, const struct steps_comparison *comparison,
                                 struct tetlod_error *error)
{
    struct steps_check check = {.file = file, .comparison = comparison, .error = error};
    struct tetmesh first = {0};
    enum tetlod_status status = open_bands(&check);
    struct steps_batch batch = {.field_count = check.field_count, .threads = comparison->threads};
    double time, *times = array_new(check.step_count, sizeof *times);
    if (status == TETLOD_OK && !times)
        status = tetlodi_fail_nomem(error, "the times", check.step_count * sizeof *times);
    if (status == TETLOD_OK && points_move(&check))
        status = read_as_it_is(&check, 0, &first, &time);
    for (uint32_t s = 0; s < check.step_count && status == TETLOD_OK; s++) {
        struct tetmesh input = {0};
        struct tetlod_error inner = {0};
        status = read_step(&check, s, &first, &input, &times[s]);
        if (status == TETLOD_OK) {
            check.error = &inner;
            status = compare_step(&check, &input, s, &batch);
            check.error = error;
            if (status != TETLOD_OK)
                tetlodi_fail(error, status, "%.230s", inner.message);
        }
        tetmesh_fini(&input);
    }
    if (status == TETLOD_OK)
        status = check_times(&check, times);
    free(times);
    tetmesh_fini(&batch.exact);
    tetmesh_fini(&first);
    close_bands(&check);
    return status;
}

/* ---- measuring */

static enum tetlod_status measure_band(const struct steps_check *check, const struct steps_batch *batch,
                                       const struct measure *measure,
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

static enum tetlod_status measure_batch(const struct steps_check *check, struct steps_batch *batch,
                                        const struct steps_watch *watch,
                                        struct steps_errors *out)
{
    uint32_t bands = check->band_count - 1; // the last one is exact
    struct measure *measure = NULL;
    struct measured *measured = array_new(batch->count, sizeof *measured);
    enum tetlod_status status = measured ? TETLOD_OK : tetlodi_fail_nomem(check->error, "a step",
                                                                          batch->count * sizeof *measured);
    if (status == TETLOD_OK)
        status = read_batch(check, batch, bands, &batch->exact);
    if (status == TETLOD_OK)
        status = measure_new(&measure, &batch->exact, NULL, batch->count, batch->threads, check->error);
    for (uint32_t b = 0; b < bands && status == TETLOD_OK; b++) {
        status = measure_band(check, batch, measure, b, measured, out);
        show_batch(check, batch, watch, b);
    }
    measure_free(measure);
    tetmesh_fini(&batch->exact);
    batch->exact = (struct tetmesh){0};
    free(measured);
    return status;
}

enum tetlod_status steps_measure(struct tetlod_file *file, uint32_t field, unsigned threads,
                                 const struct steps_watch *watch,
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
    struct steps_batch batch = {.field = field, .field_count = 1, .threads = threads};
    while (batch.first < check.step_count && status == TETLOD_OK) {
        uint32_t left = check.step_count - batch.first, most = batch_steps(&check, &batch);
        batch.count = left < most ? left : most;
        status = measure_batch(&check, &batch, watch, out);
        batch.first += batch.count;
    }
    close_bands(&check);
    return status;
}
