/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/boxes.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/jobs/cell_choice.h"
#include "server/jobs/made.h"
#include "server/routes/handlers.h"
#include "server/routes/mesh_formats.h"
#include "src/measure/region_error.h"
#include "src/stream/page_region.h"
#include "src/util/array.h"
#include "src/util/number_text.h"

struct region_choice {
    const struct mesh_format *format;
    struct tetlod_file *file; /* of the dataset that is held meanwhile */
    struct cell_choice cells;
    uint32_t coarse, fine;
    size_t box_count;
    struct region_box boxes[MAX_BOXES];
};

static struct region region_of(const struct region_choice *choice)
{
    return (struct region){choice->coarse, choice->fine, choice->boxes, choice->box_count};
}

/* ---- boxes ---- */

bool parse_boxes(struct exchange *exchange, struct region_box out[static MAX_BOXES], size_t *out_count)
{
    char text[1200];
    enum query_result result = query_value(exchange->query, "box", text, sizeof text);
    *out_count = 0;
    if (result == QUERY_ABSENT)
        return true;
    bool good = result == QUERY_FOUND;
    for (const char *at = text; good && at; ) {
        size_t size = strcspn(at, ";");
        good = *out_count < MAX_BOXES && selection_read_box(at, size, &out[*out_count]);
        ++*out_count;
        at = at[size] ? at + size + 1 : NULL;
    }
    if (!good)
        response_problem(exchange->response, 400, exchange->request->target,
                         "box is x0,y0,z0,x1,y1,z1, the least corner first; up to %d boxes are separated by ';'",
                         MAX_BOXES);
    return good;
}

bool print_boxes(struct exchange *exchange, const struct region_box *boxes, size_t count,
                 char out[static BOXES_CAPACITY])
{
    size_t used = 0;
    for (size_t i = 0; i < 6 * count; i++) {
        char number[40];
        const struct region_box *box = &boxes[i / 6];
        size_t axis = i % 3, size = print_number(number, sizeof number, i % 6 < 3 ? box->low[axis] : box->high[axis]);
        if (used + size + 2 > BOXES_CAPACITY) {
            response_problem(exchange->response, 400, exchange->request->target,
                             "these are too many boxes: write fewer, or fewer digits");
            return false;
        }
        memcpy(out + used, number, size);
        used += size;
        out[used++] = i % 6 == 5 ? ';' : ',';
    }
    out[used ? used - 1 : 0] = 0;
    return true;
}

/* ---- the answer ---- */

/* What is known of the transition; its local bounds are made true. */
static enum tetlod_status measure(const struct forest *forest, struct tetmesh *mesh, const uint32_t *tets,
                                  struct room *room, struct region_note *out, struct tetlod_error *error)
{
    const struct tetlod_info *info = forest_info(forest);
    double *errors = array_new(info->field_count, sizeof *errors);
    if (!errors)
        return tetlodi_fail_nomem(error, "a region's error", info->field_count * sizeof *errors);
    enum tetlod_status status = region_measure(forest, mesh, tets, 1, room, errors, error);
    for (uint32_t f = 0; status == TETLOD_OK && f < info->field_count; f++) {
        double range = info->fields[f].range[1] - info->fields[f].range[0];
        if (info->fields[f].controlled && range > 0)
            out->transition_error = fmax(out->transition_error, errors[f] / range);
    }
    free(errors);
    return status;
}

/* The values of cells, of the mesh and while they are decoded. */
static enum tetlod_status add_cells(const struct region_choice *choice, const uint32_t *tets, struct room *room,
                                    struct tetmesh *mesh, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(choice->file);
    const uint64_t held = room_held(room);
    TETLOD_TRY(room_take(room, cell_choice_bytes(&choice->cells, info, (uint64_t)mesh->tet_count + info->tets), error));
    TETLOD_TRY(cell_choice_add(&choice->cells, choice->file, tets, mesh, error));
    room_back_to(room, held + cell_choice_bytes(&choice->cells, info, mesh->tet_count));
    return TETLOD_OK;
}

static enum tetlod_status make_mesh(const void *opaque, const struct forest *forest, struct room *room,
                                    struct tetmesh *out, struct region_note *note, struct tetlod_error *error)
{
    const struct region_choice *choice = opaque;
    struct region region = region_of(choice);
    struct region_counts counts;
    uint32_t *tets;
    enum tetlod_status status = region_mesh(forest, &region, room, out, &tets, &counts, error);
    *note = (struct region_note){out->vertex_count, out->tet_count, counts.tets[REGION_TRANSITION], 0, false};
    if (status == TETLOD_OK)
        status = measure(forest, out, tets, room, note, error);
    if (status == TETLOD_OK)
        status = add_cells(choice, tets, room, out, error);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    free(tets);
    return status;
}

/* The same out of pages: no stream in memory is needed, and nothing is measured. */
static enum tetlod_status make_of_pages(const void *opaque, const struct forest *forest, struct room *room,
                                        struct tetmesh *out, struct region_note *note, struct tetlod_error *error)
{
    const struct region_choice *choice = opaque;
    const struct tetlod_info *info = tetlod_info(choice->file);
    struct region region = region_of(choice);
    struct tetlod_page_set *set;
    struct region_counts counts;
    uint32_t *tets, transition;
    (void)forest;
    TETLOD_TRY(page_region_set(choice->file, &region, &set, error));
    enum tetlod_status status = page_region_mesh(choice->file, set, &region, room, out, &tets, &counts, &transition,
                                                 error);
    tetlod_page_set_free(set);
    TETLOD_TRY(status);
    *note = (struct region_note){out->vertex_count, out->tet_count, counts.tets[REGION_TRANSITION], 0, true};
    for (uint32_t f = 0; transition != TETLOD_NONE && f < info->field_count; f++)
        if (info->fields[f].controlled)
            note->transition_error = fmax(note->transition_error,
                                          info->levels[transition].errors[f * TETLOD_MEASURES + TETLOD_MAX]);
    status = add_cells(choice, tets, room, out, error);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    free(tets);
    return status;
}

static enum tetlod_status write_mesh(const void *opaque, const struct tetmesh *mesh, struct buffer *out,
                                     struct tetlod_error *error)
{
    const struct region_choice *choice = opaque;
    return mesh_format_write(choice->format, mesh, out, error);
}

static enum tetlod_status measure_file(const void *opaque, const struct tetmesh *mesh, uint64_t *out,
                                       struct tetlod_error *error)
{
    const struct region_choice *choice = opaque;
    return mesh_format_measure(choice->format, mesh, out, error);
}

static void put_headers(struct response *response, struct dataset *dataset, const void *opaque,
                        const struct region_note *note)
{
    const struct region_choice *choice = opaque;
    const char *coarse = dataset_level_texts(dataset, choice->coarse)->errors;
    const char *fine = dataset_level_texts(dataset, choice->fine)->errors;
    response_header(response, "Tetlod-Level", "%" PRIu32, choice->coarse);
    response_header(response, "Tetlod-Box-Level", "%" PRIu32, choice->fine);
    if (coarse[0])
        response_header_text(response, "Tetlod-Error", coarse);
    if (fine[0])
        response_header_text(response, "Tetlod-Box-Error", fine);
    if (!note)
        return;
    response_header(response, "Tetlod-Vertices", "%" PRIu32, note->vertices);
    response_header(response, "Tetlod-Tets", "%" PRIu32, note->tets);
    response_header(response, "Tetlod-Transition-Tets", "%" PRIu32, note->transition_tets);
    response_header(response, "Tetlod-Transition-Error", "%s=%.9g", note->certified ? "max" : "measured",
                    note->transition_error);
}

/* What making takes, out of the whole stream or out of pages. False: answered. */
static bool measure_answer(struct exchange *exchange, const struct region_choice *choice, struct level_answer *answer)
{
    const struct tetlod_info *info = tetlod_info(choice->file);
    const struct region region = region_of(choice);
    struct tetlod_page_set_info pages;
    struct tetlod_page_set *set;
    if (!answer->alone) {
        answer->file_bytes = mesh_format_bytes(info, choice->fine) +
                             cell_choice_bytes(&choice->cells, info, info->levels[choice->fine].tets);
        answer->mesh_bytes = region_most_bytes(info, &region) + region_error_most_bytes(info) +
                             cell_choice_decoding(&choice->cells, info, choice->fine);
        return true;
    }
    if (page_region_set(choice->file, &region, &set, NULL) != TETLOD_OK) {
        respond_no_memory(exchange);
        return false;
    }
    tetlod_page_set_info(set, &pages);
    tetlod_page_set_free(set);
    answer->file_bytes = mesh_format_bytes_of(info, pages.vertices, pages.tets) +
                         cell_choice_bytes(&choice->cells, info, pages.tets);
    answer->mesh_bytes = page_region_bytes(info, &pages) + cell_choice_decoding(&choice->cells, info, choice->fine);
    return true;
}

static enum outcome answer_region(struct exchange *exchange, struct dataset *dataset,
                                  const struct region_choice *choice)
{
    char boxes[BOXES_CAPACITY], cells[MAX_CELL_FIELDS / 4 + 1], name[BOXES_CAPACITY + sizeof cells + 80];
    const bool of_pages = page_region_is(dataset_info(dataset), choice->fine);
    if (!print_boxes(exchange, choice->boxes, choice->box_count, boxes))
        return ANSWERED;
    cell_choice_name(&choice->cells, cells);
    snprintf(name, sizeof name, "%s-%" PRIu32 "-%s%s%s", choice->format->name, choice->coarse, boxes,
             choice->cells.any ? "-" : "",
             choice->cells.any ? cells : "");
    struct level_answer answer = {
        .level = choice->fine,
        .name = name,
        .media_type = choice->format->media_type,
        .write = write_mesh,
        .measure = measure_file,
        .choice = choice,
        .choice_size = sizeof *choice,
        .finest = !of_pages,
        .alone = of_pages,
        .mesh = of_pages ? make_of_pages : make_mesh,
        .headers = put_headers,
    };
    return measure_answer(exchange, choice, &answer) ? answer_from_level(exchange, dataset, &answer) : ANSWERED;
}

/* The field that tells the parts keeps its name to itself. */
static bool take_cells(struct exchange *exchange, const struct tetlod_info *info, struct cell_choice *out)
{
    if (!query_cells(exchange, info, (struct cell_step){0}, out))
        return false;
    uint32_t clash = tetlod_cell_field_index(info, REGION_FIELD);
    if (clash == TETLOD_NONE || !out->chosen[clash])
        return true;
    response_problem(exchange->response, 400, exchange->request->target,
                     "cells cannot have '%s' here: the field that tells the parts has that name", REGION_FIELD);
    return false;
}

static bool take_choice(struct exchange *exchange, const struct tetlod_info *info, struct region_choice *choice)
{
    char text[24];
    choice->format = take_mesh_format(exchange, exchange->captures[3], true);
    if (!choice->format || !check_parameters(exchange) ||
        !parse_level(exchange, info, exchange->captures[2], &choice->coarse) ||
        !parse_boxes(exchange, choice->boxes, &choice->box_count) || !take_cells(exchange, info, &choice->cells))
        return false;
    if (choice->box_count && query_value(exchange->query, "box_level", text, sizeof text) == QUERY_FOUND) {
        if (!parse_level(exchange, info, text, &choice->fine))
            return false;
        if (page_region_is(info, choice->fine))
            choice->coarse = page_region_outside(info, choice->coarse);
        if (choice->fine > choice->coarse)
            return true;
    }
    response_problem(exchange->response, 400, exchange->request->target,
                     "box and box_level are needed, and the box's level is finer than the level");
    return false;
}

enum outcome handle_region(struct exchange *exchange)
{
    struct region_choice choice;
    memset(&choice, 0, sizeof choice);
    choice.file = dataset_file(exchange->dataset);
    if (!take_choice(exchange, dataset_info(exchange->dataset), &choice))
        return ANSWERED;
    enum outcome outcome = answer_region(exchange, exchange->dataset, &choice);
    name_download(exchange, "-%s-region.%s", exchange->captures[2], exchange->captures[3]);
    return outcome;
}
