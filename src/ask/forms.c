/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/forms.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/stream/series_time.h"
#include "src/util/array.h"

/* How far above its figure an error may be: of it (PROOF.md 3). */
static const double TIE = 1e-9;

/* What rounding moves of a boundary that keeps its place: of the diagonal (PROOF.md 5). */
static const double KEPT = 1e-12;

static bool is_original(const struct tetlod_info *info, uint32_t level)
{
    return level + 1 == info->level_count && info->lossless;
}

/* How far the boundary has moved at most; infinite if that is not known of single points. */
static double moved_at(const struct forms *forms, uint32_t level)
{
    const struct tetlod_info *info = forms->info;
    double x = info->bounds[1][0] - info->bounds[0][0], y = info->bounds[1][1] - info->bounds[0][1];
    double z = info->bounds[1][2] - info->bounds[0][2];
    if (info->levels[level].domain_error <= KEPT || is_original(info, level))
        return 0;
    return info->lossless && !forms->series ? info->levels[level].domain_error * sqrt(x * x + y * y + z * z) * (1 + TIE)
                                            : INFINITY;
}

static double swept_at(const struct forms *forms, uint32_t level)
{
    if (moved_at(forms, level) == 0)
        return 0;
    return level < forms->summary.level_count ? forms->summary.swept[level] : INFINITY;
}

/* An error that is a fraction of the range, in the field's units; infinite if it is not known. */
static double in_units(const struct forms *forms, double error)
{
    double width = forms->range[1] - forms->range[0];
    return isnan(error) ? INFINITY : error * (width > 0 ? width : 1) * (1 + TIE);
}

static double error_of_level(const struct forms *forms, uint32_t level)
{
    if (forms->field == TETLOD_NONE || is_original(forms->info, level))
        return 0;
    return in_units(forms, forms->info->levels[level].errors[forms->field * TETLOD_MEASURES + TETLOD_MAX]);
}

/* Where points move, only what has them exactly has each value at its place. */
static double error_of_band(const struct forms *forms, uint32_t band)
{
    const struct tetlod_band *of = &tetlod_series_info(forms->series)->bands[band];
    if (forms->moves && !(of->error == 0 && is_original(forms->info, of->level)))
        return INFINITY;
    if (forms->field == TETLOD_NONE)
        return 0;
    return in_units(forms, tetlod_step_error(forms->series, forms->series_field, band, forms->step));
}

static void add_form(struct forms *forms, uint32_t level, uint32_t band, double error)
{
    double moved = moved_at(forms, level), swept = swept_at(forms, level);
    if (forms->finest != TETLOD_NONE && level <= forms->finest && !isinf(error) && (!isinf(moved) || !isinf(swept)))
        forms->forms[forms->count++] = (struct form){level, band, error, moved, swept};
}

static enum tetlod_status list(struct forms *forms, struct tetlod_error *error)
{
    const struct tetlod_info *info = forms->info;
    const struct tetlod_series_info *series = forms->series ? tetlod_series_info(forms->series) : NULL;
    uint32_t count = series ? series->band_count : info->level_count;
    forms->forms = array_new(count, sizeof *forms->forms);
    if (!forms->forms)
        return tetlodi_fail_nomem(error, "the list of levels", count * sizeof *forms->forms);
    for (uint32_t i = 0; i < count; i++)
        if (series)
            add_form(forms, series->bands[i].level, i, error_of_band(forms, i));
        else
            add_form(forms, i, TETLOD_NONE, error_of_level(forms, i));
    return TETLOD_OK;
}

enum tetlod_status forms_none(const struct forms *forms, struct tetlod_error *error)
{
    const struct tetlod_info *info = forms->info;
    const char *name = forms->field == TETLOD_NONE ? "" : info->fields[forms->field].name;
    bool bounded = forms->field == TETLOD_NONE;
    if (forms->finest == TETLOD_NONE || forms->finest + 1 < info->level_count)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED,
                            "no level of the bytes that are here certifies an answer");
    for (uint32_t i = 0; i < (forms->series ? tetlod_series_info(forms->series)->band_count : info->level_count); i++)
        bounded |= !isinf(forms->series ? error_of_band(forms, i) : error_of_level(forms, i));
    if (!bounded)
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "no level certifies %.100s: build it with --field %.100s or --certify-all", name, name);
    return tetlodi_fail(error, TETLOD_ERR_FIELD,
                        "the boundary of its levels has moved, and none certifies this answer: build it without "
                        "--position-bits, and take the whole stream, or build it with --domain-error 0, or, for means, "
                        "integrals, volumes and quantiles, with --summary");
}

static enum tetlod_status find_field(struct forms *forms, const char *name, struct tetlod_error *error)
{
    const struct tetlod_info *info = forms->info;
    forms->field = forms->bound = TETLOD_NONE;
    if (!name || !*name)
        return TETLOD_OK;
    forms->field = tetlod_field_index(info, name);
    if (forms->field == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.100s'; 'tetlod info' lists the fields",
                            name);
    memcpy(forms->range, info->fields[forms->field].range, sizeof forms->range);
    for (uint32_t f = 0; f < info->field_count && !forms->series; f++)
        if (info->fields[f].bounds == forms->field)
            forms->bound = f;
    return TETLOD_OK;
}

/* The field's number in the series. */
static enum tetlod_status find_in_series(struct forms *forms, const char *name, struct tetlod_error *error)
{
    const struct tetlod_series_info *series = tetlod_series_info(forms->series);
    forms->moves = series->displacement != TETLOD_NONE;
    for (uint32_t f = 0; f < series->field_count && forms->field != TETLOD_NONE; f++)
        if (series->fields[f] == forms->field) {
            forms->series_field = f;
            memcpy(forms->range, series->ranges[f], sizeof forms->range);
            return TETLOD_OK;
        }
    if (forms->field == TETLOD_NONE)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_FIELD, "%.100s has no steps", name);
}

static enum tetlod_status find_step(struct forms *forms, const struct step_selection *step, struct tetlod_error *error)
{
    uint64_t own;
    if (step->by_time)
        TETLOD_TRY(series_check_time(forms->file, step->time, error));
    uint32_t topology = selection_topology(forms->info, step, &own);
    if (forms->info->topology_count && topology != TETLOD_NONE) {
        TETLOD_TRY(tetlod_open_topology(&forms->part, forms->file, topology, error));
        forms->file = forms->part;
        forms->info = tetlod_info(forms->part);
    }
    TETLOD_TRY(tetlod_series_new(&forms->series, forms->file, error));
    forms->step = topology == TETLOD_NONE ? TETLOD_NONE
                                          : selection_step(tetlod_series_info(forms->series), step, own);
    if (forms->step == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no step %llu; 'tetlod info' says how many there are",
                            (unsigned long long)step->step);
    return TETLOD_OK;
}

static enum tetlod_status new_cursor(struct forms *forms, struct tetlod_error *error)
{
    uint32_t fields[2] = {0}, count = 0;
    if (!forms->series && forms->field != TETLOD_NONE)
        fields[count++] = forms->field;
    if (forms->bound != TETLOD_NONE)
        fields[count++] = forms->bound;
    if (forms->series)
        tetlod_series_select(forms->series, &forms->series_field, 1);
    return tetlod_cursor_new(&forms->cursor, forms->file, fields, count, error);
}

enum tetlod_status forms_init(struct forms *forms, struct tetlod_file *file, uint32_t finest, const char *name,
                              const struct step_selection *step, struct tetlod_error *error)
{
    *forms = (struct forms){.file = file, .info = tetlod_info(file)};
    if (step)
        TETLOD_TRY(find_step(forms, step, error));
    TETLOD_TRY(find_field(forms, name, error));
    if (forms->series)
        TETLOD_TRY(find_in_series(forms, name, error));
    else
        TETLOD_TRY(tetlodi_summary_read(file, &forms->summary, error));
    if (!forms->series)
        TETLOD_TRY(tetlodi_box_sums_read(file, &forms->boxes, error));
    forms->finest = forms->part ? forms->info->level_count - 1 : finest;
    return list(forms, error);
}

void forms_fini(struct forms *forms)
{
    tetlod_cursor_free(forms->cursor);
    tetlod_series_free(forms->series);
    tetlodi_summary_fini(&forms->summary);
    tetlodi_box_sums_fini(&forms->boxes);
    tetlod_close(forms->part);
    free(forms->forms);
    free(forms->moved);
    *forms = (struct forms){0};
}

static enum tetlod_status move(struct forms *forms, struct form_mesh *mesh, struct tetlod_error *error)
{
    free(forms->moved);
    forms->moved = array_new(mesh->vertices, 3 * sizeof *forms->moved);
    if (!forms->moved)
        return tetlodi_fail_nomem(error, "a step's points", mesh->vertices * (uint64_t)24);
    memcpy(forms->moved, mesh->positions, mesh->vertices * 3 * sizeof *forms->moved);
    mesh->positions = forms->moved;
    return tetlod_step_move(forms->series, forms->moved, error);
}

enum tetlod_status forms_take(struct forms *forms, uint32_t number, struct form_mesh *out, struct tetlod_error *error)
{
    const struct form *form = &forms->forms[number];
    struct tetlod_mesh mesh;
    if (!forms->cursor)
        TETLOD_TRY(new_cursor(forms, error));
    if (forms->series)
        TETLOD_TRY(tetlod_seek_step(forms->series, forms->cursor, form->band, forms->step, error));
    else
        TETLOD_TRY(tetlod_cursor_seek(forms->cursor, form->level, error));
    tetlod_cursor_mesh(forms->cursor, &mesh);
    *out = (struct form_mesh){.vertices = mesh.vertices, .tets = mesh.tets, .positions = mesh.positions,
                              .corners = mesh.corners};
    if (forms->series)
        out->values = tetlod_step_values(forms->series, forms->series_field);
    else if (forms->field != TETLOD_NONE)
        out->values = mesh.fields[forms->field];
    if (forms->bound != TETLOD_NONE && form->error > 0)
        out->bounds = mesh.fields[forms->bound];
    return forms->moves ? move(forms, out, error) : TETLOD_OK;
}

enum tetlod_status forms_bytes(const struct forms *forms, uint32_t number, uint64_t *out, struct tetlod_error *error)
{
    const struct form *form = &forms->forms[number];
    uint32_t fields[2] = {forms->field, forms->bound};
    uint32_t count = forms->series || forms->field == TETLOD_NONE ? 0 : forms->bound == TETLOD_NONE ? 1 : 2;
    size_t spans = tetlod_spans(forms->file, TETLOD_NONE, form->level, fields, count, NULL, 0);
    struct tetlod_span *all = array_new(spans, sizeof *all);
    if (!all)
        return tetlodi_fail_nomem(error, "the places of the levels", spans * sizeof *all);
    tetlod_spans(forms->file, TETLOD_NONE, form->level, fields, count, all, spans);
    *out = 0;
    for (size_t s = 0; s < spans; s++)
        *out += all[s].size;
    free(all);
    if (forms->series) {
        uint32_t moves = tetlod_series_info(forms->series)->displacement;
        uint32_t time = tetlod_section_index(forms->info, "TIME");
        *out += tetlod_step_span(forms->series, forms->series_field, form->band, forms->step).size;
        *out += forms->moves ? tetlod_step_span(forms->series, moves, form->band, forms->step).size : 0;
        *out += time == TETLOD_NONE ? 0 : forms->info->sections[time].stored;
    }
    return TETLOD_OK;
}
