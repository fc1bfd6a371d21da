/* SPDX-License-Identifier: BSD-3-Clause */
/* A level as a mesh file. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "server/http/respond.h"
#include "server/jobs/cell_choice.h"
#include "server/jobs/made.h"
#include "server/jobs/streamed.h"
#include "server/routes/frames.h"
#include "server/routes/handlers.h"
#include "server/routes/mesh_formats.h"
#include "server/routes/steps.h"

/* A file with the values of cells that are asked for. */
struct mesh_choice {
    struct step_choice step; /* first: step_answer */
    const struct mesh_format *format;
    const struct tetlod_file *file; /* of the dataset that is held meanwhile */
    struct cell_choice cells;
};

static enum tetlod_status write_mesh(const void *opaque, const struct tetmesh *mesh, struct buffer *out,
                                     struct tetlod_error *error)
{
    const struct mesh_choice *choice = opaque;
    struct tetmesh with = *mesh; // all but the values of cells is borrowed
    enum tetlod_status status =
        choice->step.any ? cell_choice_add_step(&choice->cells, choice->file, choice->step.step, &with, error)
                         : cell_choice_add(&choice->cells, choice->file, NULL, &with, error);
    if (status == TETLOD_OK)
        status = mesh_format_write(choice->format, &with, out, error);
    for (uint32_t f = 0; f < with.cell_field_count; f++)
        point_field_fini(&with.cell_fields[f]);
    free(with.cell_fields);
    return status;
}

static enum outcome answer_made(struct exchange *exchange, struct dataset *dataset, uint32_t level,
                                const struct mesh_choice *choice)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char name[16 + STEP_NAME + MAX_CELL_FIELDS / 4 + 1], cells[MAX_CELL_FIELDS / 4 + 1], of_step[STEP_NAME];
    cell_choice_name(&choice->cells, cells);
    step_name(&choice->step, of_step);
    snprintf(name, sizeof name, "%s%s%s%s", choice->format->name, of_step, choice->cells.any ? "-" : "",
             choice->cells.any ? cells : "");
    struct level_answer answer = {.level = level,
                                  .name = name,
                                  .media_type = choice->format->media_type,
                                  .file_bytes = mesh_format_bytes(info, level) +
                                                cell_choice_decoding(&choice->cells, info, level),
                                  .write = write_mesh,
                                  .choice = choice,
                                  .choice_size = sizeof *choice};
    if (choice->step.any)
        step_answer(&answer, info);
    if (choice->step.any || fits_cache(exchange->site, info, &answer)) // a step is decoded all at once
        return answer_from_level(exchange, dataset, &answer);
    return answer_streamed(exchange, dataset,
                           &(struct streamed_answer){level, name, choice->format->media_type, choice->format->lay_out,
                                                     &choice->cells});
}

static enum outcome answer_file(struct exchange *exchange, struct dataset *dataset, uint32_t level,
                                const struct mesh_format *format)
{
    struct mesh_choice choice = {.format = format, .file = dataset_file(dataset)};
    if (!query_cells(exchange, dataset_info(dataset), (struct cell_step){0}, &choice.cells))
        return ANSWERED;
    if (format->write)
        return answer_made(exchange, dataset, level, &choice);
    if (choice.cells.any) {
        response_problem(exchange->response, 400, exchange->request->target,
                         "cells is for mesh files; those of a stream lie behind its last level, in the section CVAL");
        return ANSWERED;
    }
    enum outcome outcome = answer_immutable(exchange, respond_level_prefix(exchange, dataset, level));
    if (outcome == ANSWERED && exchange->response->status == 200)
        level_headers(exchange->response, dataset, level);
    return outcome;
}

static enum outcome answer_step(struct exchange *exchange, struct dataset *dataset)
{
    struct mesh_choice choice = {.file = dataset_file(dataset)};
    enum outcome outcome = ANSWERED;
    if (captured_step(exchange, dataset, &choice.step) &&
        (choice.format = take_mesh_format(exchange, exchange->captures[4], true)) &&
        query_cells(exchange, dataset_info(dataset), (struct cell_step){dataset_series(dataset), choice.step.step},
                    &choice.cells))
        outcome = answer_made(exchange, dataset, choice.step.level, &choice);
    name_download(exchange, "-step%" PRIu32 "-%s.%s", step_number(&choice.step), exchange->captures[2],
                  exchange->captures[4]);
    return outcome;
}

static enum outcome answer_level(struct exchange *exchange, struct dataset *dataset)
{
    const struct mesh_format *format = take_mesh_format(exchange, exchange->captures[3], false);
    enum outcome outcome = ANSWERED;
    uint32_t level;
    if (format && parse_level(exchange, dataset_info(dataset), exchange->captures[2], &level))
        outcome = answer_file(exchange, dataset, level, format);
    name_download(exchange, "-%s.%s", exchange->captures[2], exchange->captures[3]);
    return outcome;
}

enum outcome handle_mesh_file(struct exchange *exchange)
{
    if (!check_parameters(exchange))
        return ANSWERED;
    return exchange->of_step ? answer_step(exchange, exchange->dataset) : answer_level(exchange, exchange->dataset);
}
