/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/steps.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "src/stream/level_mesh.h"
#include "src/stream/metadata.h"
#include "src/stream/series_time.h"
#include "src/stream/selection.h"
#include "src/util/array.h"
#include "src/util/number_text.h"

/* ---- what is asked for */

/* NULL: answered. */
static const struct tetlod_series_info *series_info(struct exchange *exchange, const struct dataset *dataset)
{
    const struct tetlod_series *series = dataset_series(dataset);
    if (!series)
        response_problem(exchange->response, 404, exchange->request->target, "'%s' is not a series in time",
                         dataset_id(dataset));
    return series ? tetlod_series_info(series) : NULL;
}

/* Beyond half a step outside of the series the nearest step is not what was meant. False: answered. */
static bool check_time(struct exchange *exchange, const struct tetlod_info *stream,
                       const struct tetlod_series_info *info, double time)
{
    struct series_times times;
    if (series_has_time(stream, info, time, &times))
        return true;
    response_problem(exchange->response, 422, exchange->request->target,
                     "there is no time %.9g: times go from %.9g to %.9g; the nearest is %.9g", time, times.first,
                     times.last, time < times.first ? times.first : times.last);
    return false;
}

/* Reads the parameter `step` or `time` of a series. False: answered. */
static bool read_step(struct exchange *exchange, struct dataset *whole, struct step_selection *selection)
{
    const struct tetlod_info *stream = dataset_info(whole);
    const struct tetlod_series_info *info = tetlod_series_info(dataset_series(whole));
    uint32_t count = series_step_count(stream, info), number = 0;
    char time[80], step[24];
    enum query_result by_time = query_value(exchange->query, "time", time, sizeof time);
    enum query_result by_step = query_value(exchange->query, "step", step, sizeof step);
    selection->by_time = by_time == QUERY_FOUND;
    if (by_time == QUERY_ABSENT && by_step == QUERY_FOUND) {
        if (!take_number(exchange, step, "step", count, &number))
            return false;
    } else if (by_step != QUERY_ABSENT || by_time != QUERY_FOUND || !text_number(time, false, &selection->time)) {
        print_number(time, sizeof time, info->times[info->step_count - 1]);
        response_problem(exchange->response, 400, exchange->request->target,
                         "give one number, once: time=%s or step=%" PRIu32, time, count - 1);
        return false;
    }
    selection->step = number;
    return !selection->by_time || check_time(exchange, stream, info, selection->time);
}

static bool has_step(struct exchange *exchange)
{
    char text[2];
    return query_value(exchange->query, "time", text, sizeof text) != QUERY_ABSENT ||
        query_value(exchange->query, "step", text, sizeof text) != QUERY_ABSENT;
}

enum query_result query_step_selection(struct exchange *exchange, struct dataset *dataset, struct step_selection *out)
{
    *out = (struct step_selection){0};
    if (!has_step(exchange))
        return QUERY_ABSENT;
    return series_info(exchange, dataset) && read_step(exchange, dataset, out) ? QUERY_FOUND : QUERY_BAD;
}

/* Sets the step that the parameter `step` or `time` means, and the topology group that has it. */
static bool take_step(struct exchange *exchange, struct dataset *whole, struct step_selection *selection,
                      struct step_choice *out)
{
    const struct tetlod_info *stream = dataset_info(whole);
    uint64_t own;
    if (!read_step(exchange, whole, selection))
        return false;
    out->dataset = dataset_topology(whole, selection_topology(stream, selection, &own));
    out->step = selection_step(tetlod_series_info(dataset_series(out->dataset)), selection, own);
    return true;
}

static bool take_band(struct exchange *exchange, struct step_selection *selection, struct step_choice *out)
{
    const struct tetlod_series_info *info = tetlod_series_info(dataset_series(out->dataset));
    char fraction[80], units[80];
    enum query_result by_fraction = query_value(exchange->query, "error", fraction, sizeof fraction);
    enum query_result by_units = query_value(exchange->query, "abs_error", units, sizeof units);
    bool absolute = selection->absolute = by_units == QUERY_FOUND;
    if (!((by_fraction == QUERY_FOUND && by_units == QUERY_ABSENT) || (absolute && by_fraction == QUERY_ABSENT)) ||
        !text_number(absolute ? units : fraction, !absolute, &selection->error) || selection->error < 0) {
        response_problem(exchange->response, 400, exchange->request->target,
                         "a step goes with one of error=0.01 and abs_error=0.2, a number of at least 0");
        return false;
    }
    selection->own_ranges = metadata_own_ranges(dataset_info(out->dataset));
    out->band = selection_band(dataset_series(out->dataset), selection, out->step);
    if (out->band != TETLOD_NONE) {
        out->level = info->bands[out->band].level;
        return true;
    }
    response_problem(exchange->response, 422, exchange->request->target,
                     "no band of the series is within that error: the finest has %g, a fraction of the range over all "
                     "steps",
                     info->bands[info->band_count - 1].error);
    return false;
}

enum query_result query_step(struct exchange *exchange, struct dataset *dataset, const char *names,
                             struct step_choice *out)
{
    struct step_selection selection = {0};
    *out = (struct step_choice){.any = true};
    if (!has_step(exchange))
        return QUERY_ABSENT;
    bool good = series_info(exchange, dataset) && check_parameters_of(exchange, names) &&
                take_step(exchange, dataset, &selection, out) && take_band(exchange, &selection, out);
    return good ? QUERY_FOUND : QUERY_BAD;
}

bool captured_band(struct exchange *exchange, struct dataset *dataset, struct step_choice *out)
{
    const struct tetlod_series_info *info = series_info(exchange, dataset);
    *out = (struct step_choice){.any = true, .dataset = dataset};
    if (!info || !take_number(exchange, exchange->captures[2], "band", info->band_count, &out->band))
        return false;
    out->level = info->bands[out->band].level;
    return true;
}

bool captured_step(struct exchange *exchange, struct dataset *dataset, struct step_choice *out)
{
    return captured_band(exchange, dataset, out) &&
           take_number(exchange, exchange->captures[3], "step",
                       tetlod_series_info(dataset_series(dataset))->step_count, &out->step);
}

uint32_t field_with_steps(const struct dataset *dataset, uint32_t field)
{
    const struct tetlod_series_info *info = tetlod_series_info(dataset_series(dataset));
    for (uint32_t f = 0; f < info->field_count; f++)
        if (info->fields[f] == field)
            return f;
    return TETLOD_NONE;
}

/* ---- its mesh */

/* The mesh keeps the fields that have steps, in the series' order, with the step's values. */
static enum tetlod_status put_values(struct tetmesh *mesh, const struct tetlod_series *series,
                                     struct tetlod_error *error)
{
    const struct tetlod_series_info *info = tetlod_series_info(series);
    struct point_field *kept = array_zero(info->field_count, sizeof *kept);
    if (!kept)
        return tetlodi_fail_nomem(error, "a step", info->field_count * sizeof *kept);
    for (uint32_t f = 0; f < info->field_count; f++) {
        struct point_field *field = &mesh->fields[info->fields[f]];
        memcpy(field->values, tetlod_step_values(series, f),
               (size_t)mesh->vertex_count * field->components * sizeof *field->values);
        kept[f] = *field;
        *field = (struct point_field){0};
    }
    for (uint32_t f = 0; f < mesh->field_count; f++)
        point_field_fini(&mesh->fields[f]);
    free(mesh->fields);
    mesh->fields = kept;
    mesh->field_count = info->field_count;
    return TETLOD_OK;
}

static enum tetlod_status make_step(const void *opaque, const struct forest *forest, struct room *room,
                                    struct tetmesh *out, struct region_note *note, struct tetlod_error *error)
{
    const struct step_choice *choice = opaque;
    (void)room;
    (void)note;
    struct tetlod_series *series; // one that decodes is for one thread
    TETLOD_TRY(forest_mesh(forest, choice->level, out, error));
    enum tetlod_status status = tetlod_series_new(&series, dataset_file(choice->dataset), error);
    if (status == TETLOD_OK)
        status = tetlod_series_decode(series, out->corners, choice->band, choice->step, error);
    if (status == TETLOD_OK)
        status = put_values(out, series, error);
    if (status == TETLOD_OK)
        status = tetlod_step_move(series, out->positions, error);
    if (status == TETLOD_OK)
        level_mesh_step_origin(forest_info(forest), series, choice->band, choice->step, out);
    tetlod_series_free(series);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}

/* Memory that decoding takes beside the mesh. Of a vertex: neighbours, and codes, values and scratch of each component;
 * of a tetrahedron: its edges while they are sorted. */
static uint64_t decoding_bytes(const struct tetlod_info *info, uint32_t level)
{
    uint64_t components = 0;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return info->levels[level].vertices * (64 + 40 * components) + info->levels[level].tets * (uint64_t)64 + 65536;
}

/* ---- in words */

void step_name(const struct step_choice *choice, char out[STEP_NAME])
{
    out[0] = 0;
    if (choice->any)
        snprintf(out, STEP_NAME, "-%" PRIu32 "-%" PRIu32, choice->band, choice->step);
}

uint32_t step_number(const struct step_choice *choice)
{
    return dataset_steps_before(choice->dataset) + choice->step;
}

void step_headers(struct response *response, const struct step_choice *choice)
{
    const struct dataset *dataset = choice->dataset;
    const struct tetlod_series *series = dataset_series(dataset);
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    const struct tetlod_level *level = &dataset_info(dataset)->levels[choice->level];
    double error = 0;
    for (uint32_t f = 0; f < steps->field_count; f++)
        error = fmax(error, tetlod_step_error(series, f, choice->band, choice->step));
    response_header(response, "Tetlod-Level", "%" PRIu32, choice->level);
    response_header(response, "Tetlod-Vertices", "%" PRIu64, level->vertices);
    response_header(response, "Tetlod-Tets", "%" PRIu64, level->tets);
    response_header(response, "Tetlod-Band", "%" PRIu32, choice->band);
    response_header(response, "Tetlod-Step", "%" PRIu32, step_number(choice));
    response_header(response, "Tetlod-Topology", "%" PRIu32, dataset_topology_number(dataset));
    response_header(response, "Tetlod-Time", "%.17g", steps->times[choice->step]);
    response_header(response, "Tetlod-Error", "max=%.9g", error);
}

static void put_headers(struct response *response, struct dataset *dataset, const void *opaque,
                        const struct region_note *note)
{
    (void)dataset;
    (void)note;
    step_headers(response, opaque);
}

void step_answer(struct level_answer *answer, const struct tetlod_info *info)
{
    answer->mesh = make_step;
    answer->headers = put_headers;
    answer->mesh_bytes = decoding_bytes(info, answer->level);
}
