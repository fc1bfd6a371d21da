/* SPDX-License-Identifier: BSD-3-Clause */
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/jobs/cell_choice.h"
#include "server/routes/boxes.h"
#include "server/routes/frames.h"
#include "server/routes/groups.h"
#include "server/routes/handlers.h"
#include "server/routes/mesh_formats.h"
#include "src/stream/page_region.h"
#include "src/stream/selection.h"
#include "src/util/number_text.h"

static const char *const kind_names[] = {[TAKE_ERROR] = "error", [TAKE_ABS_ERROR] = "abs_error", [TAKE_LEVEL] = "level",
                                         [TAKE_TETS] = "tets", [TAKE_BYTES] = "bytes"};

struct choice {
    struct selection selection; /* box_count 0: no box, or none that is finer */
    char text[80];              /* the amount's */
    char format[16];
    uint32_t box_level;
    struct cell_choice cells;
};

static const char redirected[] = "The mesh is at the address of the Location header.\n";

static const char *target_of(const struct exchange *exchange)
{
    return exchange->request->target;
}

static json_t *known_measures(const struct tetlod_info *info, uint32_t field)
{
    json_t *array = json_array();
    for (int m = 0; m < TETLOD_MEASURES; m++)
        if (selection_measured(info, field, (enum tetlod_measure)m))
            json_array_append_new(array, json_string(tetlod_measure_name((enum tetlod_measure)m)));
    return array;
}

static bool parse_budget(struct exchange *exchange, struct choice *choice)
{
    int given = 0;
    for (int kind = TAKE_ERROR; kind <= TAKE_BYTES; kind++) {
        char text[sizeof choice->text];
        enum query_result result = query_value(exchange->query, kind_names[kind], text, sizeof text);
        if (result == QUERY_BAD) {
            response_problem(exchange->response, 400, target_of(exchange),
                             "%s cannot be read: it is given once, and in an address a percent sign is written %%25, "
                             "as in error=1%%25", kind_names[kind]);
            return false;
        }
        if (result == QUERY_ABSENT)
            continue;
        given++;
        choice->selection.kind = (enum selection_kind)kind;
        memcpy(choice->text, text, sizeof text);
    }
    if (given == 1)
        return true;
    response_problem_choices(exchange->response, 400, target_of(exchange), "parameters",
                             json_texts(kind_names + TAKE_ERROR, TAKE_BYTES),
                             given ? "give one of error, abs_error, level, tets and bytes, once"
                                   : "say which mesh: error=0.01 or another of error, abs_error, level, tets and "
                                     "bytes");
    return false;
}

static bool parse_error(struct exchange *exchange, enum selection_kind kind, const char *name, const char *text,
                        double *out)
{
    if (text_number(text, kind == TAKE_ERROR, out) && *out >= 0)
        return true;
    response_problem(exchange->response, 400, target_of(exchange),
                     "%s is a finite number of at least 0, such as %s, not '%s'",
                     name, kind == TAKE_ERROR ? "0.01 or 1%25" : "0.5", text);
    return false;
}

static bool parse_amount(struct exchange *exchange, const struct tetlod_info *info, struct choice *choice)
{
    struct selection *selection = &choice->selection;
    const char *name = kind_names[selection->kind];
    if (selection->kind == TAKE_ERROR || selection->kind == TAKE_ABS_ERROR)
        return parse_error(exchange, selection->kind, name, choice->text, &selection->error);
    if (selection->kind == TAKE_LEVEL) {
        if (text_count(choice->text, false, &selection->count) && selection->count < info->level_count)
            return true;
        response_problem(exchange->response, 400, target_of(exchange),
                         "level is a whole number from 0 to %" PRIu32 ", not '%s'",
                         info->level_count - 1, choice->text);
        return false;
    }
    if (text_count(choice->text, true, &selection->count))
        return true;
    response_problem(exchange->response, 400, target_of(exchange),
                     "%s is a whole number such as 50000 or 4M, not '%s'", name,
                     choice->text);
    return false;
}

static bool parse_field(struct exchange *exchange, const struct tetlod_info *info, struct choice *choice)
{
    char name[256] = "";
    enum query_result result = query_form_value(exchange->query, "field", name, sizeof name);
    choice->selection.field = result == QUERY_FOUND ? tetlod_field_index(info, name) : TETLOD_NONE;
    query_value(exchange->query, "field", name, sizeof name);
    if (result == QUERY_FOUND && tetlod_field_index(info, name) != TETLOD_NONE)
        choice->selection.field = tetlod_field_index(info, name);
    if (result == QUERY_ABSENT || choice->selection.field != TETLOD_NONE)
        return true;
    response_problem_choices(exchange->response, 400, target_of(exchange), "fields", field_names(info),
                             "there is no field '%.128s'", result == QUERY_FOUND ? name : "");
    return false;
}

/* `needed`: the index must have it. */
static bool parse_measure(struct exchange *exchange, const struct tetlod_info *info, struct choice *choice, bool needed)
{
    char name[32] = "max";
    enum tetlod_measure m = TETLOD_MEASURES;
    if (query_value(exchange->query, "measure", name, sizeof name) != QUERY_BAD)
        m = selection_measure(name);
    choice->selection.measure = m;
    if (m != TETLOD_MEASURES && (!needed || selection_measured(info, choice->selection.field, m)))
        return true;
    json_t *measures = known_measures(info, choice->selection.field);
    char known[80] = "";
    for (size_t i = 0; i < json_array_size(measures); i++)
        snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", i ? ", " : "",
                 json_string_value(json_array_get(measures, i)));
    response_problem_choices(exchange->response, 400, target_of(exchange), "measures", measures,
                             m < TETLOD_MEASURES
                                 ? "this stream does not hold the measure '%s' of that error; add measure= with one "
                                   "of: %s"
                                 : "there is no measure '%s'; add measure= with one of: %s",
                             name, known);
    return false;
}

static bool parse_format(struct exchange *exchange, struct choice *choice, bool from_mesh)
{
    snprintf(choice->format, sizeof choice->format, "vtu");
    if (query_value(exchange->query, "format", choice->format, sizeof choice->format) == QUERY_BAD)
        choice->format[0] = 0;
    return take_mesh_format(exchange, choice->format, from_mesh) != NULL;
}

static void redirect(struct exchange *exchange, const struct dataset *dataset, const struct choice *choice,
                     uint32_t level)
{
    struct response *response = exchange->response;
    const struct tetlod_info *info = dataset_info(dataset);
    char boxes[BOXES_CAPACITY];
    const char *cells = choice->cells.any ? choice->cells.text : "";
    if (choice->selection.box_count &&
        !print_boxes(exchange, choice->selection.boxes, choice->selection.box_count, boxes))
        return;
    response_static(response, 303, "text/plain; charset=utf-8", redirected);
    if (choice->selection.box_count) // from .../mesh
        response_header(response, "Location", "%s/levels/%" PRIu32 "/region.%s?box_level=%" PRIu32 "&box=%s%s%s",
                        info->cid, level,
                        choice->format, choice->box_level, boxes, choice->cells.any ? "&cells=" : "", cells);
    else
        response_header(response, "Location", "%s/levels/%" PRIu32 "/mesh.%s%s%s", info->cid, level, choice->format,
                        choice->cells.any ? "?cells=" : "", cells);
    level_headers(response, dataset, level);
    cache_revalidate(response);
}

static void respond_no_level(struct exchange *exchange, const struct dataset *dataset, const char *error)
{
    response_problem(exchange->response, 422, target_of(exchange),
                     "no level has an error of at most %s: the stream is not lossless, its finest level has %s "
                     "(fractions of the range)",
                     error, dataset_level_texts(dataset, dataset_info(dataset)->level_count - 1)->errors);
}

/* The level that the query asks for; false: answered. */
static bool ask_level(struct exchange *exchange, const struct dataset *dataset, struct choice *choice, uint32_t *out)
{
    const struct tetlod_info *info = dataset_info(dataset);
    if (!parse_budget(exchange, choice) || !parse_amount(exchange, info, choice) ||
        !parse_field(exchange, info, choice) ||
        !parse_measure(exchange, info, choice, choice->selection.kind <= TAKE_ABS_ERROR))
        return false;
    *out = selection_level(info, &choice->selection);
    if (*out != TETLOD_NONE)
        return true;
    respond_no_level(exchange, dataset, choice->text);
    return false;
}

/* Boxes, and the level in them; *level is the one outside, which pages may make finer. False: answered. */
static bool ask_boxes(struct exchange *exchange, const struct dataset *dataset, struct choice *choice, uint32_t *level)
{
    struct selection *selection = &choice->selection;
    const struct tetlod_info *info = dataset_info(dataset);
    bool absolute = selection->kind == TAKE_ABS_ERROR;
    char text[sizeof choice->text] = "0";
    enum query_result result = query_value(exchange->query, "box_error", text, sizeof text);
    if (!parse_boxes(exchange, selection->boxes, &selection->box_count))
        return false;
    if (result == QUERY_BAD || (result == QUERY_FOUND && !selection->box_count)) {
        response_problem(exchange->response, 400, target_of(exchange), "box_error is one number, and goes with box");
        return false;
    }
    if (!selection->box_count)
        return true;
    selection->box_finest = result == QUERY_ABSENT;
    if (!parse_error(exchange, absolute ? TAKE_ABS_ERROR : TAKE_ERROR, "box_error", text, &selection->box_error))
        return false;
    if (!parse_measure(exchange, info, choice, true))
        return false;
    choice->box_level = selection_box_level(info, selection);
    if (choice->box_level == TETLOD_NONE) {
        respond_no_level(exchange, dataset, text);
        return false;
    }
    if (choice->box_level <= *level)
        selection->box_count = 0;
    else if (page_region_is(info, choice->box_level))
        *level = page_region_outside(info, *level);
    return true;
}

/* To the step's immutable URL. */
static enum outcome redirect_to_step(struct exchange *exchange, const struct step_choice *step)
{
    const struct tetlod_info *info = dataset_info(step->dataset);
    struct choice choice = {0};
    if (!parse_format(exchange, &choice, true) ||
        !query_cells(exchange, info, (struct cell_step){dataset_series(step->dataset), step->step}, &choice.cells))
        return ANSWERED;
    response_static(exchange->response, 303, "text/plain; charset=utf-8", redirected);
    response_header(exchange->response, "Location", "%s/bands/%" PRIu32 "/steps/%" PRIu32 "/mesh.%s%s%s", info->cid,
                    step->band, step->step,
                    choice.format, choice.cells.any ? "?cells=" : "", choice.cells.any ? choice.cells.text : "");
    step_headers(exchange->response, step);
    cache_revalidate(exchange->response);
    return ANSWERED;
}

enum outcome handle_mesh(struct exchange *exchange)
{
    struct dataset *dataset = exchange->dataset;
    struct choice choice = {0};
    struct step_choice step;
    uint32_t level;
    enum query_result asked = query_step(exchange, dataset, "error abs_error time step format cells", &step);
    if (asked != QUERY_ABSENT)
        return asked == QUERY_FOUND ? redirect_to_step(exchange, &step) : ANSWERED;
    if (check_parameters(exchange) && ask_level(exchange, dataset, &choice, &level) &&
        ask_boxes(exchange, dataset, &choice, &level) && parse_format(exchange, &choice, choice.selection.box_count) &&
        query_cells(exchange, dataset_info(dataset), (struct cell_step){0}, &choice.cells))
        redirect(exchange, dataset, &choice, level);
    return ANSWERED;
}

static enum outcome answer_step_prefix(struct exchange *exchange, const struct step_choice *step)
{
    enum outcome outcome = respond_step_prefix(exchange, step);
    if (outcome == ANSWERED && exchange->response->status == 200) {
        step_headers(exchange->response, step);
        cache_revalidate(exchange->response);
    }
    return outcome;
}

/* Stored bytes cost nothing to choose: a client's first request is answered without a redirection. */
enum outcome handle_prefix(struct exchange *exchange)
{
    struct dataset *dataset = exchange->dataset;
    struct choice choice = {0};
    struct step_choice step;
    uint32_t level;
    enum query_result asked = query_step(exchange, dataset, "error abs_error time step fields", &step);
    if (asked != QUERY_ABSENT)
        return asked == QUERY_FOUND ? answer_step_prefix(exchange, &step) : ANSWERED;
    if (!check_parameters(exchange) || !ask_level(exchange, dataset, &choice, &level))
        return ANSWERED;
    enum outcome outcome = respond_prefix(exchange, dataset, level);
    if (outcome == ANSWERED && exchange->response->status == 200) {
        level_headers(exchange->response, dataset, level);
        cache_revalidate(exchange->response);
    }
    return outcome;
}
