/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/against.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/log/coarsening.h"
#include "src/measure/measure_levels.h"
#include "src/measure/overlay.h"
#include "src/measure/same.h"
#include "src/report/level_mesh.h"
#include "src/util/array.h"

/*
 * A lossless stream is walked down from its finest level, which is the input but for the order, as its own original: what a
 * level has in common with the one above it is then not measured again. A slot keeps its number as long as it lives, and
 * so do tetrahedra: what a cursor shows at a level is a step of a coarsening.
 */
struct against {
    const struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    const struct tetmesh *input;
    const struct against_options *options;
    struct against_report *report;
    struct tetlod_error *error;
    const struct tetmesh *original; /* that levels are compared with: the finest level, or the input of a lossy stream */
    uint32_t *fields;               /* [field_count] of the original */
    double *scales;                 /* [field_count] 1 / range, of the input */
    uint32_t *level_fields;         /* [field_count] of a level: all in order */
    struct measured *measured;      /* [field_count] */
    double *exact;                  /* [field_count] */
    double diagonal;
    struct measure *measure;
    struct tetmesh finest;
    struct tetmesh level;      /* at hand */
    uint32_t *parents;         /* [slot] */
    struct coarsening coarsening;
    struct measure_levels *measure_levels; /* of a lossless stream */
};

static enum tetlod_status nomem(const struct against *a)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    return tetlodi_fail_nomem(a->error, "the comparison", 16 * ((uint64_t)info->vertices + info->tets));
}

/* ---- going down */

/* Is the last level an exact tail: the mesh of the level before it, with other values? */
static bool has_tail(const struct tetlod_info *info)
{
    const struct tetlod_level *last = &info->levels[info->level_count - 1];
    return info->level_count > 1 && last->vertices == last[-1].vertices && last->tets == last[-1].tets;
}

static enum tetlod_status begin(struct against *a)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct tetlod_mesh mesh;
    struct tetmesh coded;
    TETLOD_TRY(tetlod_cursor_seek(a->cursor, info->level_count - 1, a->error));
    TETLOD_TRY(level_mesh_copy(info, a->cursor, &a->finest, a->error));
    if (!info->lossless)
        return TETLOD_OK;
    TETLOD_TRY(mesh_same(a->input, &a->finest, a->error));
    a->original = &a->finest;
    memcpy(a->fields, a->level_fields, info->field_count * sizeof *a->fields);
    a->parents = array_new(info->vertices, sizeof *a->parents);
    if (!a->parents)
        return nomem(a);
    tetlod_cursor_mesh(a->cursor, &mesh);
    memcpy(a->parents, mesh.parents, info->vertices * sizeof *a->parents);
    TETLOD_TRY(tetlod_cursor_seek(a->cursor, info->level_count - 1 - has_tail(info), a->error));
    TETLOD_TRY(level_mesh_copy(info, a->cursor, &coded, a->error));
    enum tetlod_status status = coarsening_init(&a->coarsening, &coded, NULL, a->error);
    tetmesh_fini(&coded);
    TETLOD_TRY(status);
    return measure_levels_new(&a->measure_levels, &a->finest, &a->coarsening, a->options->threads, a->error);
}

static bool same_slot(const struct tetmesh *a, const struct tetmesh *b, size_t v)
{
    bool same = memcmp(a->positions + 3 * v, b->positions + 3 * v, 3 * sizeof(double)) == 0;
    for (uint32_t f = 0; f < a->field_count && same; f++) {
        size_t k = a->fields[f].components;
        same = memcmp(a->fields[f].values + k * v, b->fields[f].values + k * v, k * sizeof(double)) == 0;
    }
    return same;
}

/* From the level above, `from`, to the one in a->level. */
static enum tetlod_status step(struct against *a, const struct tetmesh *from)
{
    const struct tetmesh *level = &a->level;
    const double **values = array_new(level->field_count, sizeof *values);
    if (!values)
        return nomem(a);
    for (uint32_t f = 0; f < level->field_count; f++)
        values[f] = level->fields[f].values;
    for (uint32_t v = from->vertex_count; v-- > level->vertex_count;)
        coarsening_merge(&a->coarsening, v, a->parents[v]);
    for (uint32_t v = 0; v < level->vertex_count; v++)
        if (!same_slot(from, level, v))
            coarsening_move(&a->coarsening, v, level->positions, values, v);
    free(values);
    coarsening_step(&a->coarsening, a->options->threads);
    return TETLOD_OK;
}

static enum tetlod_status measure_this(struct against *a, uint32_t k, double *out_domain)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct tetmesh above = a->level;
    *out_domain = 0;
    a->level = (struct tetmesh){0};
    enum tetlod_status status = tetlod_cursor_seek(a->cursor, k, a->error);
    if (status == TETLOD_OK)
        status = level_mesh_copy(info, a->cursor, &a->level, a->error);
    if (status == TETLOD_OK && info->lossless && k + 1 + has_tail(info) < info->level_count)
        status = step(a, &above);
    if (has_tail(info) && info->lossless && k + 1 == info->level_count) // mesh_same has found it to be the input
        memset(a->measured, 0, info->field_count * sizeof *a->measured);
    else if (status == TETLOD_OK && info->lossless)
        status = measure_levels_next(a->measure_levels, a->measured, out_domain, a->error);
    else if (status == TETLOD_OK)
        status = measure_mesh(a->measure, &a->level, a->level_fields, a->options->threads, a->measured, out_domain, a->error);
    tetmesh_fini(&above);
    return status;
}

/* ---- what the index says */

/* Two ways of measuring differ by the rounding of positions, which is that of the largest coordinate; a mean also where the
 * original has several values, of which the build knows the right one and we take the nearest. */
static bool honest(const struct tetlod_info *info, double stored, double measured, enum tetlod_measure measure)
{
    double largest = 0, smallest_side = INFINITY;
    for (int d = 0; d < 3; d++) {
        largest = fmax(largest, fmax(fabs(info->bounds[0][d]), fabs(info->bounds[1][d])));
        smallest_side = fmin(smallest_side, info->bounds[1][d] - info->bounds[0][d]);
    }
    double rounding = smallest_side > 0 ? 1e-12 * largest / smallest_side : 0;
    return measured <= stored * (measure == TETLOD_RMS ? 1 + 1e-3 : 1 + 1e-6) + 1e-9 + rounding;
}

static enum tetlod_status check_measured(const struct against *a, uint32_t k, double domain)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    if (!honest(info, info->levels[k].domain_error, domain, TETLOD_MAX))
        return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "level %u: its domain error is %g, stored is %g", k, domain,
                            info->levels[k].domain_error);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const double *errors = info->levels[k].errors + f * TETLOD_MEASURES;
        const double now[2] = {a->measured[f].sampled * a->scales[f], a->measured[f].rms * a->scales[f]};
        for (int i = 0; i < 2; i++)
            if (!honest(info, errors[TETLOD_SAMPLED + i], now[i], (enum tetlod_measure)(TETLOD_SAMPLED + i)))
                return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "level %u, %.60s: its %s error is %g, stored is %g", k,
                                    info->fields[f].name,
                                    tetlod_measure_name((enum tetlod_measure)(TETLOD_SAMPLED + i)), now[i],
                                    errors[TETLOD_SAMPLED + i]);
        if (!isnan(errors[TETLOD_MAX]) && !honest(info, errors[TETLOD_MAX], now[0], TETLOD_MAX))
            return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "level %u, %.60s: certified is %g, but measured is %g", k,
                                info->fields[f].name, errors[TETLOD_MAX], now[0]);
    }
    return TETLOD_OK;
}

static enum tetlod_status check_exact(const struct against *a, uint32_t k)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct overlay_report overlay;
    TETLOD_TRY(overlay_max(a->original, a->fields, &a->level, a->level_fields, info->field_count, a->options->threads,
                           a->exact, &overlay, a->error));
    for (uint32_t f = 0; f < info->field_count; f++) {
        double certified = info->levels[k].errors[f * TETLOD_MEASURES + TETLOD_MAX], now = a->exact[f] * a->scales[f];
        if (!isnan(certified) && !honest(info, certified, now, TETLOD_MAX))
            return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "level %u, %.60s: certified is %g, but the exact maximum is %g",
                                k, info->fields[f].name, certified, now);
    }
    return TETLOD_OK;
}

/* Is this one of the levels for the exact maximum? Level 0 always is. */
static bool is_spread(const struct tetlod_info *info, uint32_t k)
{
    uint32_t below = info->level_count - 1, count = below < AGAINST_MOST_EXACT ? below : AGAINST_MOST_EXACT;
    for (uint32_t i = 0; i < count; i++)
        if (k == (uint64_t)i * (below - 1) / (count > 1 ? count - 1 : 1))
            return true;
    return false;
}

static enum tetlod_status check_levels(struct against *a)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    for (uint32_t k = info->level_count; k-- > 0;) {
        double domain;
        TETLOD_TRY(measure_this(a, k, &domain));
        TETLOD_TRY(check_measured(a, k, a->diagonal > 0 ? domain / a->diagonal : 0));
        a->report->measured++;
        if (is_spread(info, k)) {
            TETLOD_TRY(check_exact(a, k));
            a->report->exact[a->report->exact_count++] = k;
        }
        if (a->options->progress)
            a->options->progress(a->options->progress_opaque, 1 - (double)k / info->level_count);
    }
    return TETLOD_OK;
}

/* ---- the whole */

static enum tetlod_status prepare(struct against *a)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    a->fields = array_new(info->field_count, sizeof *a->fields);
    a->level_fields = array_new(info->field_count, sizeof *a->level_fields);
    a->scales = array_new(info->field_count, sizeof *a->scales);
    a->measured = array_new(info->field_count, sizeof *a->measured);
    a->exact = array_new(info->field_count, sizeof *a->exact);
    if (!a->fields || !a->level_fields || !a->scales || !a->measured || !a->exact)
        return nomem(a);
    a->original = a->input;
    a->diagonal = mesh_diagonal(a->input);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const double *stored = info->fields[f].range;
        double range[2];
        a->level_fields[f] = f;
        a->fields[f] = tetmesh_find_field(a->input, info->fields[f].name);
        if (a->fields[f] == TETLOD_NONE || a->input->fields[a->fields[f]].components != info->fields[f].components)
            return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "the input has no field '%.60s' of %u components",
                                info->fields[f].name, info->fields[f].components);
        point_field_range(&a->input->fields[a->fields[f]], a->input->vertex_count, range);
        if (range[0] != stored[0] || range[1] != stored[1])
            return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "%.60s: the input's range is %g .. %g, stored is %g .. %g",
                                info->fields[f].name, range[0], range[1], stored[0], stored[1]);
        a->scales[f] = range[1] > range[0] ? 1 / (range[1] - range[0]) : 0;
    }
    return TETLOD_OK;
}

enum tetlod_status against_check(const struct tetlod_file *file, struct tetlod_cursor *cursor, const struct tetmesh *input,
                                 const struct against_options *options, struct against_report *report,
                                 struct tetlod_error *error)
{
    struct against a = {.file = file, .cursor = cursor, .input = input, .options = options, .report = report, .error = error};
    enum tetlod_status status;
    *report = (struct against_report){0};
    TETLOD_TRY_DONE(prepare(&a));
    TETLOD_TRY_DONE(begin(&a));
    if (!tetlod_info(file)->lossless)
        TETLOD_TRY_DONE(measure_new(&a.measure, a.original, a.fields, tetlod_info(file)->field_count, options->threads, error));
    status = check_levels(&a);
done:
    measure_free(a.measure);
    measure_levels_free(a.measure_levels);
    coarsening_fini(&a.coarsening);
    tetmesh_fini(&a.level);
    tetmesh_fini(&a.finest);
    free(a.parents);
    free(a.fields);
    free(a.level_fields);
    free(a.scales);
    free(a.measured);
    free(a.exact);
    return status;
}
