/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/extract_step.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/displacement.h"
#include "src/stream/level_mesh.h"
#include "src/stream/metadata.h"
#include "src/report/promise.h"
#include "src/stream/series_time.h"

struct step_choice {
    const struct step_selection *selection;
    uint64_t step;          /* in its topology group */
    uint32_t before, total; /* steps of the topology groups before, and of all of them; 0: there is one mesh */
};

static enum tetlod_status fail_step(uint32_t count, uint64_t step, struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "it has %u steps, 0 to %u; there is no step %llu", count, count - 1,
                        (unsigned long long)step);
}

static void describe(const struct tetlod_series *series, const struct tetlod_info *info,
                     const struct step_choice *choice, uint32_t band,
                     uint32_t step, char *about, size_t size)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    int used = snprintf(about, size, "step %u of 0..%u, time %.9g, level %u", choice->before + step,
                        (choice->total ? choice->total
                         : steps->step_count) - 1, steps->times[step], steps->bands[band].level);
    for (uint32_t f = 0; f < steps->field_count && used >= 0 && (size_t)used < size; f++)
        used += snprintf(about + used, size - (size_t)used, "%s%.60s within %.3g %% of its range over the series",
                         f ? ", " : ": ", info->fields[steps->fields[f]].name,
                         promise_percent(tetlod_step_error(series, f, band, step)));
}

/* Moves the points, and says what that turns over. */
static enum tetlod_status move(const struct tetlod_series *series, const struct tetlod_cursor *cursor,
                               struct tetmesh *out, char *about,
                               size_t about_size, struct tetlod_error *error)
{
    struct tetlod_mesh rest;
    tetlod_cursor_mesh(cursor, &rest);
    TETLOD_TRY(tetlod_step_move(series, out->positions, error));
    size_t used = strlen(about);
    snprintf(about + used, about_size - used, "; points moved, which turns over %" PRIu64 " of %" PRIu32 " tetrahedra",
             displacement_turned(rest.positions, out->positions, out->corners, out->tet_count), out->tet_count);
    return TETLOD_OK;
}

/* The step's values of cells; says which are not known there: those without steps, and of a file that is cut off those
 * that are missing. */
static enum tetlod_status take_cells(const struct tetlod_file *file, struct tetlod_series *series, uint32_t step,
                                     struct tetmesh *out, char *about, size_t about_size, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    const char *before = "; without the values of cells ";
    for (uint32_t f = 0; f < info->cell_field_count; f++) {
        enum tetlod_status status = level_mesh_step_cells(file, series, step, f, out, error);
        if (status != TETLOD_OK && status != TETLOD_ERR_TRUNCATED)
            return status;
        if (status == TETLOD_OK && tetlod_has_step_cells(series, f, step))
            continue;
        size_t used = strlen(about);
        snprintf(about + used, about_size - used, "%s%.60s", before, info->cell_fields[f].name);
        before = ", ";
    }
    if (*before == ',') {
        size_t used = strlen(about);
        snprintf(about + used, about_size - used, ", which are not known at this step");
    }
    return TETLOD_OK;
}

static enum tetlod_status take(struct tetlod_file *file, struct tetlod_series *series, struct tetlod_cursor *cursor,
                               const struct step_choice *choice, struct tetmesh *out, char *about, size_t about_size,
                               struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    uint32_t step = selection_step(steps, choice->selection, choice->step);
    if (step == TETLOD_NONE)
        return fail_step(steps->step_count, choice->step, error);
    uint32_t band = selection_band(series, choice->selection, step);
    if (band == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "none of its bands is within an error of %g",
                            choice->selection->error);
    TETLOD_TRY(tetlod_seek_step(series, cursor, band, step, error));
    TETLOD_TRY(level_mesh_copy(info, cursor, out, error));
    describe(series, info, choice, band, step, about, about_size);
    TETLOD_TRY(level_mesh_step(info, series, out, error));
    level_mesh_step_origin(info, series, band, step, out);
    TETLOD_TRY(take_cells(file, series, step, out, about, about_size, error));
    return steps->displacement == TETLOD_NONE ? TETLOD_OK : move(series, cursor, out, about, about_size, error);
}

static enum tetlod_status extract_from(struct tetlod_file *file, const struct step_choice *choice, enum level_form form,
                                       struct tetmesh *out, char *about, size_t about_size, struct tetlod_error *error)
{
    static const uint32_t none[1] = {0};
    struct tetlod_series *series = NULL;
    struct tetlod_cursor *cursor = NULL;
    enum tetlod_status status = tetlod_series_new(&series, file, error);
    if (status == TETLOD_OK)
        status = tetlod_cursor_new(&cursor, file, none, 0, error); // positions alone: the fields' values are the step's
    if (status == TETLOD_OK)
        status = take(file, series, cursor, choice, out, about, about_size, error);
    if (status == TETLOD_OK)
        status = level_mesh_form(file, form, true, out, error);
    tetlod_cursor_free(cursor);
    tetlod_series_free(series);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}

enum tetlod_status extract_step(struct tetlod_file *file, const struct step_selection *selection, enum level_form form,
                                struct tetmesh *out, char *about, size_t about_size, struct tetlod_error *error)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct step_selection wanted = *selection;
    struct step_choice choice = {.selection = &wanted};
    struct tetlod_file *part;
    uint32_t topology = selection_topology(info, selection, &choice.step);
    wanted.own_ranges = metadata_own_ranges(info);
    if (selection->by_time)
        TETLOD_TRY(series_check_time(file, selection->time, error));
    if (!info->topology_count)
        return extract_from(file, &choice, form, out, about, about_size, error);
    choice.total = series_steps_before(info, info->topology_count);
    if (topology == TETLOD_NONE)
        return fail_step(choice.total, selection->step, error);
    choice.before = series_steps_before(info, topology);
    TETLOD_TRY(tetlod_open_topology(&part, file, topology, error));
    enum tetlod_status status = extract_from(part, &choice, form, out, about, about_size, error);
    tetlod_close(part);
    return status;
}
