/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/jobs/cell_choice.h"

#include <string.h>

#include "format/fail.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "src/stream/level_mesh.h"

static bool is_known(struct cell_step at, uint32_t field)
{
    return !at.series || tetlod_has_step_cells(at.series, field, at.step);
}

static json_t *cell_names(const struct tetlod_info *info, struct cell_step at)
{
    json_t *array = json_array();
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        if (is_known(at, f))
            json_array_append_new(array, json_string(info->cell_fields[f].name));
    return array;
}

/* Chooses what the first name of a list says. Its length with the comma behind, or 0. */
static size_t choose(const struct tetlod_info *info, struct cell_step at, char *list, const char *form,
                     struct cell_choice *out)
{
    uint32_t field = TETLOD_NONE;
    size_t all = list_begins_with(list, "all"), size = 0;
    if (info->cell_field_count)
        size = list_find_either(list, form, &info->cell_fields[0].name, sizeof *info->cell_fields,
                                info->cell_field_count, &field);
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        if (is_known(at, f) && (f == field || (all && !size)))
            out->chosen[f] = out->any = true;
    if (size)
        return is_known(at, field) ? size : 0;
    return all;
}

bool query_cells(struct exchange *exchange, const struct tetlod_info *info, struct cell_step at,
                 struct cell_choice *out)
{
    char list[1024], form[sizeof list];
    *out = (struct cell_choice){0};
    enum query_result result = query_value(exchange->query, "cells", list, sizeof list);
    if (result == QUERY_ABSENT)
        return true;
    if (result == QUERY_BAD) {
        response_problem(exchange->response, 400, exchange->request->target,
                         "cells is one list of names of at most %zu bytes in all, or all",
                         sizeof list - 1);
        return false;
    }
    query_form_value(exchange->query, "cells", form, sizeof form);
    size_t size = 1;
    for (char *name = list; *name && size; name += size)
        if (!(size = choose(info, at, name, form + (name - list), out)))
            response_problem_choices(exchange->response, 400, exchange->request->target, "cells", cell_names(info, at),
                                     "there are no values of cells '%.*s'%s; names are separated by commas",
                                     (int)strcspn(name, ","), name, at.series ? " at this step" : "");
    return size > 0 && percent_encode(list, out->text, sizeof out->text);
}

void cell_choice_name(const struct cell_choice *choice, char out[MAX_CELL_FIELDS / 4 + 1])
{
    for (size_t i = 0; i < MAX_CELL_FIELDS / 4; i++) {
        const bool *four = choice->chosen + 4 * i;
        out[i] = "0123456789abcdef"[8 * four[0] + 4 * four[1] + 2 * four[2] + four[3]];
    }
    out[MAX_CELL_FIELDS / 4] = 0;
}

uint64_t cell_choice_bytes(const struct cell_choice *choice, const struct tetlod_info *info, uint64_t tets)
{
    uint64_t components = 0;
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        components += choice->chosen[f] ? info->cell_fields[f].components : 0;
    return components * tets * 8;
}

uint64_t cell_choice_decoding(const struct cell_choice *choice, const struct tetlod_info *info, uint32_t level)
{
    return cell_choice_bytes(choice, info, (uint64_t)info->levels[level].tets + info->tets);
}

enum tetlod_status cell_choice_add(const struct cell_choice *choice, const struct tetlod_file *file,
                                   const uint32_t *tets,
                                   struct tetmesh *mesh, struct tetlod_error *error)
{
    for (uint32_t f = 0; f < tetlod_info(file)->cell_field_count; f++)
        if (choice->chosen[f])
            TETLOD_TRY(level_mesh_cells(file, f, tets, mesh, error));
    return TETLOD_OK;
}

enum tetlod_status cell_choice_add_step(const struct cell_choice *choice, const struct tetlod_file *file, uint32_t step,
                                        struct tetmesh *mesh, struct tetlod_error *error)
{
    struct tetlod_series *series; // one that decodes is for one thread
    enum tetlod_status status = choice->any ? tetlod_series_new(&series, file, error) : TETLOD_OK;
    if (!choice->any || status != TETLOD_OK)
        return status;
    for (uint32_t f = 0; f < tetlod_info(file)->cell_field_count && status == TETLOD_OK; f++)
        if (choice->chosen[f])
            status = level_mesh_step_cells(file, series, step, f, mesh, error);
    tetlod_series_free(series);
    return status;
}
