/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * From the finest level to the coarsest, each level k:
 *   1. its sampled and rms errors, measured as the build does, by what changed since level k + 1 (measure_levels.h).
 * They must be what is stored; if they are not, measure_range.h says what they may be;
 *   2. the distance of the boundaries (boundary_check.h) must not be above the stored domain error;
 *   3. the exact maximum over the overlay, in the tetrahedra that changed (overlay.h), must not be above `max`.
 * A level's stored error is at least that of the next finer one, so that what is larger there accounts for it.
 */
#include "src/cli/against.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/grids.h"
#include "src/cli/tolerance.h"
#include "src/log/coarsening.h"
#include "src/measure/boundary_check.h"
#include "src/measure/match.h"
#include "src/measure/measure_levels.h"
#include "src/measure/measure_range.h"
#include "src/measure/overlay.h"
#include "src/measure/same.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/stream/level_mesh.h"
#include "src/stream/metadata.h"
#include "src/util/array.h"

/* What the index may round an error up by: it keeps 16 binary digits (format/SPEC.md, 15). A measured error that is
 * larger is refused. */
static const double TOO_LARGE = 0x1p-15 + 1e-9;

/* What it may be too small by without a closer look: a point in an almost flat tetrahedron is located to few digits. */
static const double TOO_SMALL = 0x1p-20;

/* Work up to which the exact maximum is taken of all levels: tetrahedra of the original times levels. */
static const double MAX_WORK = 4e6;

struct against {
    const struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    const struct tetmesh *input;
    const struct against_options *options;
    struct against_report *report;
    struct tetlod_error *error;
    const struct tetmesh *original; /* that levels are compared with: in the stream's numbering, if that is known */
    bool numbered;                  /* it is */
    uint32_t *fields;               /* [field_count] of the original */
    uint32_t *level_fields;         /* [field_count] of a level: all in order */
    struct measured *measured;      /* [field_count] */
    double *exact, *floors;         /* [field_count] */
    struct measured_range *ranges;  /* [field_count] */
    struct measured *rounding;      /* [field_count] what an exact tail's values are off by at the level before it */
    double diagonal;
    struct tetmesh finest, renumbered;
    struct tetmesh level;      /* the current one */
    uint32_t *parents;         /* [slot] */
    uint32_t *bodies;          /* [slot] */
    uint8_t *touched;          /* [slot] by the last step */
    uint8_t *usable, *wanted;  /* [tet of the level] */
    bool all_touched;
    struct sheets sheets;      /* of the original */
    struct coarsening coarsening;
    struct measure_levels *measure_levels;
    struct boundary_check *boundary;
    struct clusters clusters;  /* of the original */
    uint32_t *neighbours;      /* [4 * tet of the level] */
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

/* By how much the level before an exact tail is off where nothing was contracted. */
static void find_rounding(struct against *a, const struct tetmesh *coded)
{
    for (uint32_t f = 0; f < coded->field_count; f++) {
        size_t count = (size_t)coded->vertex_count * coded->fields[f].components;
        const double *here = coded->fields[f].values, *there = a->finest.fields[f].values;
        double most = 0, sum = 0;
        for (size_t i = 0; i < count; i++)
            most = larger(most, fabs(here[i] - there[i]));
        for (size_t i = 0; i < count && most > 0; i++) { // of fractions: no square is too small or too large
            double by = (here[i] - there[i]) / most;
            sum += by * by;
        }
        a->rounding[f] = (struct measured){most, count ? most * sqrt(sum / (double)count) : 0};
    }
}

/* ---- the finest level */

/* Is the finest level's a field of the input, rounded or not? A local bound on a grid is 0 in the input, and no less
 * than the grid's origin. */
static bool is_of_input(const struct against *a, uint32_t f)
{
    const struct tetlodi_grid grid = tetlodi_field_grid(a->file, f);
    return tetlod_info(a->file)->fields[f].bounds == TETLOD_NONE || !grid.bits;
}

/* A copy of the input, or of it in the stream's numbering, with numbers as the finest level has them. Corners and
 * values of cells are borrowed. */
static enum tetlod_status round_mesh(const struct against *a, const struct tetmesh *mesh, struct tetmesh *out)
{
    struct tetlodi_grid axes[3];
    *out = (struct tetmesh){.vertex_count = mesh->vertex_count,
                            .tet_count = mesh->tet_count,
                            .position_type = mesh->position_type,
                            .corners = mesh->corners,
                            .cell_fields = mesh->cell_fields,
                            .cell_field_count = mesh->cell_field_count};
    out->positions = array_new(mesh->vertex_count, 3 * sizeof(double));
    if (!out->positions)
        return nomem(a);
    for (unsigned i = 0; i < 3; i++)
        axes[i] = tetlodi_position_grid(a->file, i);
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        out->positions[i] = tetlodi_grid_value(&axes[i % 3], mesh->positions[i]);
    for (uint32_t f = 0; f < a->finest.field_count; f++) {
        const struct point_field *from = &mesh->fields[tetmesh_find_field(mesh, a->finest.fields[f].name)];
        const struct tetlodi_grid grid = tetlodi_field_grid(a->file, f);
        if (!is_of_input(a, f))
            continue;
        TETLOD_TRY(tetmesh_add_field(out, from->name, from->components, from->type, a->error));
        for (size_t i = 0; i < (size_t)mesh->vertex_count * from->components; i++)
            out->fields[out->field_count - 1].values[i] = tetlodi_grid_value(&grid, from->values[i]);
    }
    return TETLOD_OK;
}

static void release_rounded(struct tetmesh *mesh)
{
    mesh->corners = NULL;
    mesh->cell_fields = NULL;
    mesh->cell_field_count = 0;
    tetmesh_fini(mesh);
}

/* The finest level without the fields that are not the input's. Everything is borrowed, but for the list of fields. */
static enum tetlod_status view_finest(const struct against *a, struct tetmesh *out)
{
    *out = a->finest;
    out->field_count = 0;
    out->fields = array_new(a->finest.field_count, sizeof *out->fields);
    if (!out->fields)
        return nomem(a);
    for (uint32_t f = 0; f < a->finest.field_count; f++)
        if (is_of_input(a, f))
            out->fields[out->field_count++] = a->finest.fields[f];
    return TETLOD_OK;
}

/* Is every vertex of the finest level, by the stream's own order, that of the input? */
static enum tetlod_status check_kept_order(const struct against *a, const struct tetmesh *finest)
{
    struct tetmesh rounded;
    enum tetlod_status status = round_mesh(a, &a->renumbered, &rounded);
    bool same = status == TETLOD_OK && memcmp(rounded.positions, finest->positions,
                                              (size_t)finest->vertex_count * 3 * sizeof(double)) == 0;
    for (uint32_t f = 0; f < finest->field_count && same; f++)
        same = memcmp(rounded.fields[f].values, finest->fields[f].values,
                      (size_t)finest->vertex_count * finest->fields[f].components * sizeof(double)) == 0;
    release_rounded(&rounded);
    if (status == TETLOD_OK && !same)
        status = tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,
                              "the original order that the stream keeps is not the input's");
    return status;
}

/* Finds the stream's vertices in the input; a->numbered, if it does. */
static enum tetlod_status find_numbers(struct against *a, const struct tetmesh *rounded, const struct tetmesh *finest)
{
    uint32_t *vertices = array_new(finest->vertex_count, sizeof *vertices);
    enum tetlod_status status = vertices ? mesh_match(rounded, finest, vertices, &a->numbered, a->error) : nomem(a);
    if (status == TETLOD_OK && a->numbered)
        status = level_mesh_gather(&a->finest, a->input, vertices, &a->renumbered, a->error);
    free(vertices);
    return status;
}

/* The original in the stream's numbering, if that is known. */
static enum tetlod_status take_original(struct against *a)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct tetmesh rounded, finest = {0};
    bool same_size = info->vertices == a->input->vertex_count && info->tets == a->input->tet_count;
    if (!same_size && metadata_is_part(info))
        return TETLOD_OK;
    TETLOD_TRY(level_mesh_cells(a->file, TETLOD_NONE, NULL, &a->finest, a->error));
    enum tetlod_status status = round_mesh(a, a->input, &rounded);
    if (status == TETLOD_OK)
        status = view_finest(a, &finest);
    if (status == TETLOD_OK)
        status = mesh_same(&rounded, &finest, a->error);
    a->numbered = info->lossless || info->keeps_order;
    if (status == TETLOD_OK && info->keeps_order) {
        status = level_mesh_renumber(a->file, &a->finest, a->input, &a->renumbered, a->error);
        if (status == TETLOD_OK)
            status = check_kept_order(a, &finest);
    } else if (status == TETLOD_OK && !info->lossless) {
        status = find_numbers(a, &rounded, &finest);
    }
    free(finest.fields);
    release_rounded(&rounded);
    if (status != TETLOD_OK || !a->numbered)
        return status;
    a->original = info->lossless ? &a->finest : &a->renumbered;
    memcpy(a->fields, a->level_fields, info->field_count * sizeof *a->fields);
    return TETLOD_OK;
}

static enum tetlod_status begin(struct against *a)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct tetlod_mesh mesh;
    struct tetmesh coded;
    TETLOD_TRY(tetlod_cursor_seek(a->cursor, info->level_count - 1, a->error));
    TETLOD_TRY(level_mesh_copy(info, a->cursor, &a->finest, a->error));
    TETLOD_TRY(take_original(a));
    TETLOD_TRY(clusters_build(&a->clusters, a->original, a->error));
    if (!a->numbered)
        return boundary_check_new(&a->boundary, a->original, NULL, a->options->threads, a->error);
    tetlod_cursor_mesh(a->cursor, &mesh);
    a->parents = array_new(info->vertices, sizeof *a->parents);
    a->bodies = array_new(info->vertices, sizeof *a->bodies);
    a->touched = array_zero(info->vertices, 1);
    if (!a->parents || !a->bodies || !a->touched)
        return nomem(a);
    memcpy(a->parents, mesh.parents, info->vertices * sizeof *a->parents);
    sheets_bodies(a->original->corners, a->original->tet_count, a->original->vertex_count, a->bodies);
    TETLOD_TRY(sheets_find(&a->sheets, a->original, NULL, a->error));
    TETLOD_TRY(boundary_check_new(&a->boundary, a->original, a->bodies, a->options->threads, a->error));
    TETLOD_TRY(tetlod_cursor_seek(a->cursor, info->level_count - 1 - has_tail(info), a->error));
    TETLOD_TRY(level_mesh_copy(info, a->cursor, &coded, a->error));
    if (has_tail(info))
        find_rounding(a, &coded);
    enum tetlod_status status = coarsening_init(&a->coarsening, &coded, NULL, a->error);
    if (status == TETLOD_OK)
        coarsening_adopt_corners(&a->coarsening, &coded);
    tetmesh_fini(&coded);
    TETLOD_TRY(status);
    return measure_levels_new(&a->measure_levels, a->original, &a->coarsening, a->options->threads, a->error);
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
    memset(a->touched, 0, from->vertex_count);
    for (uint32_t f = 0; f < level->field_count; f++)
        values[f] = level->fields[f].values;
    for (uint32_t v = from->vertex_count; v-- > level->vertex_count;) {
        coarsening_merge(&a->coarsening, v, a->parents[v]);
        a->touched[v] = a->touched[a->parents[v]] = 1;
    }
    for (uint32_t v = 0; v < level->vertex_count; v++)
        if (!same_slot(from, level, v)) {
            coarsening_move(&a->coarsening, v, level->positions, values, v);
            a->touched[v] = 1;
        }
    free(values);
    return coarsening_step(&a->coarsening, a->options->threads, a->error);
}

/* The tail: of a lossless stream mesh_same has found it to be the input. */
static enum tetlod_status measure_tail(struct against *a, double *out_domain)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct coarsening exact = {0};
    struct measure_levels *measure = NULL;
    enum tetlod_status status = TETLOD_OK;
    memset(a->measured, 0, info->field_count * sizeof *a->measured);
    if (info->lossless)
        return TETLOD_OK;
    TETLOD_TRY_DONE(coarsening_init(&exact, &a->finest, NULL, a->error));
    TETLOD_TRY_DONE(measure_levels_new(&measure, a->original, &exact, a->options->threads, a->error));
    TETLOD_TRY_DONE(measure_levels_next(measure, a->measured, out_domain, a->error));
done:
    measure_levels_free(measure);
    coarsening_fini(&exact);
    return status;
}

/* The level becomes the current one, and is measured. The domain error comes out as a length. */
static enum tetlod_status measure_this(struct against *a, uint32_t k, double *out_domain)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct tetmesh above = a->level;
    bool tail = has_tail(info), first = k + 1 + (tail && a->numbered) >= info->level_count;
    *out_domain = 0;
    a->level = (struct tetmesh){0};
    a->all_touched = first || !a->numbered;
    enum tetlod_status status = tetlod_cursor_seek(a->cursor, k, a->error);
    if (status == TETLOD_OK)
        status = level_mesh_copy(info, a->cursor, &a->level, a->error);
    if (status == TETLOD_OK && a->numbered && !first)
        status = step(a, &above);
    if (status == TETLOD_OK && a->numbered && tail && k + 1 == info->level_count)
        status = measure_tail(a, out_domain);
    else if (status == TETLOD_OK && a->numbered)
        status = measure_levels_next(a->measure_levels, a->measured, out_domain, a->error);
    tetmesh_fini(&above);
    return status;
}

/* ---- what the index says */

static double stored_error(const struct tetlod_info *info, uint32_t k, uint32_t field, enum tetlod_measure measure)
{
    return k < info->level_count ? info->levels[k].errors[field * TETLOD_MEASURES + (uint32_t)measure] : 0;
}

static double of_measured(const struct measured *measured, enum tetlod_measure measure)
{
    return measure == TETLOD_RMS ? measured->rms : measured->sampled;
}

/* Of the next finer level of which it is known. */
static double finer_error(const struct tetlod_info *info, uint32_t k, uint32_t field, enum tetlod_measure measure)
{
    double error = stored_error(info, ++k, field, measure);
    while (isnan(error))
        error = stored_error(info, ++k, field, measure);
    return error;
}

/* Is the stored error between the two, or what it is for the sake of the next finer level? Some are not known (3.4) */
static enum tetlod_status check_between(const struct against *a, uint32_t k, uint32_t f, enum tetlod_measure measure,
                                        const struct measured *least, const struct measured *most)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    double stored = stored_error(info, k, f, measure), finer = finer_error(info, k, f, measure);
    const double *range = info->fields[f].range;
    double low = range_fraction(range, of_measured(least, measure)),
           high = range_fraction(range, of_measured(most, measure));
    bool tail_above = has_tail(info) && k + 1 < info->level_count;
    high = larger(larger(high, finer), tail_above ? range_fraction(range, of_measured(&a->rounding[f], measure)) : 0);
    if (isnan(stored))
        return TETLOD_OK;
    // of a range without scale it is 0 or the whole, by the last bit of a number that has few
    if (range[1] > range[0] && !range_has_scale(range) && (stored == 0 || stored == 1))
        return TETLOD_OK;
    if (stored >= low * (1 - TOO_SMALL) - NOISE && stored <= high * (1 + TOO_LARGE) + NOISE)
        return TETLOD_OK;
    return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "level %u, %.60s: its %s error is %.9g, stored is %.9g", k,
                        info->fields[f].name, tetlod_measure_name(measure), stored < low ? low : high, stored);
}

/* Are the stored errors within the range that rounding and the mesh leave? */
static enum tetlod_status check_range(const struct against *a, uint32_t k, bool within,
                                      const struct measure_levels *measured)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    TETLOD_TRY(measure_range(a->original, a->bodies, &a->level, within, measured, a->options->threads, a->ranges,
                             a->error));
    for (uint32_t f = 0; f < info->field_count; f++)
        for (int i = 0; i < 2; i++)
            TETLOD_TRY(check_between(a, k, f, (enum tetlod_measure)(TETLOD_SAMPLED + i), &a->ranges[f].least,
                                     &a->ranges[f].most));
    return TETLOD_OK;
}

static enum tetlod_status check_sampled(const struct against *a, uint32_t k)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    enum tetlod_status status = TETLOD_OK;
    if (!a->numbered)
        return TETLOD_OK;
    for (uint32_t f = 0; f < info->field_count && status == TETLOD_OK; f++)
        for (int i = 0; i < 2 && status == TETLOD_OK; i++)
            status = check_between(a, k, f, (enum tetlod_measure)(TETLOD_SAMPLED + i), &a->measured[f],
                                   &a->measured[f]);
    bool is_tail = has_tail(info) && k + 1 == info->level_count; // measured by itself
    if (status == TETLOD_ERR_MISMATCH && !is_tail)
        status = check_range(a, k, true, a->measure_levels);
    for (int wider = 0; wider < 2 && status == TETLOD_ERR_MISMATCH; wider++)
        status = check_range(a, k, !wider, NULL);
    return status;
}

/* No bound is below what was measured. */
static enum tetlod_status check_order(const struct against *a, uint32_t k)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    for (uint32_t f = 0; f < info->field_count; f++) {
        double max = stored_error(info, k, f, TETLOD_MAX), sampled = stored_error(info, k, f, TETLOD_SAMPLED);
        if (max < sampled * (1 - TIE) - NOISE)
            return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,
                                "level %u, %.60s: certified is %.9g, but measured is %.9g", k,
                                info->fields[f].name, max, sampled);
    }
    return TETLOD_OK;
}

static enum tetlod_status check_domain(const struct against *a, uint32_t k, double measured)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    double stored = info->levels[k].domain_error, found;
    TETLOD_TRY(boundary_check_level(a->boundary, &a->level, a->neighbours, a->all_touched ? NULL : a->touched,
                                    stored * a->diagonal, &found, a->error));
    found = larger(found, measured > stored * a->diagonal * (1 + TIE) + 4e-12 * a->diagonal ? measured : 0);
    if (found > 0)
        return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,
                            "level %u: its domain error is at least %.9g, stored is %.9g", k, found / a->diagonal,
                            stored);
    return TETLOD_OK;
}

/* ---- the exact maximum */

/* Which of the level's tetrahedra may hold a larger difference than the next finer level has. */
static enum tetlod_status choose_tets(struct against *a, struct overlay_options *options)
{
    const struct tetmesh *level = &a->level;
    if (!a->numbered)
        return TETLOD_OK;
    for (size_t t = 0; t < level->tet_count; t++) {
        const double *p[4];
        a->wanted[t] = a->all_touched;
        for (int c = 0; c < 4; c++) {
            uint32_t v = level->corners[4 * t + (size_t)c];
            p[c] = level->positions + 3 * (size_t)v;
            a->wanted[t] |= a->touched[v];
        }
        a->usable[t] = tet_orientation(p[0], p[1], p[2], p[3]) == sheets_orientation(&a->sheets, t);
    }
    options->bodies[0] = options->bodies[1] = a->bodies;
    options->usable[0] = a->sheets.promised;
    options->usable[1] = a->usable;
    options->wanted = a->wanted;
    return TETLOD_OK;
}

/* What rounding may make of a difference of two values, and its limit. */
static double largest_local(double most, const double range[2])
{
    return largest_difference(0, range) + most * (1 + TIE) + 4 * DBL_EPSILON * larger(fabs(range[0]), fabs(range[1]));
}

/* The local bound `bound` of the level: with b its values, M the largest of them and s the bounded field's, |s - psi|
 * <= b everywhere if neither s + (M - b) nor s - (M - b) is further than M from psi. */
static enum tetlod_status check_local(struct against *a, uint32_t k, uint32_t bound, struct overlay_options options)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    uint32_t bounded = info->fields[bound].bounds;
    const uint32_t original[2] = {a->fields[bounded], a->fields[bounded]}, shifted[2] = {0, 1};
    const struct point_field *field = &a->level.fields[bounded];
    size_t components = field->components, count = components * a->level.vertex_count;
    const double *bounds = a->level.fields[bound].values;
    double *values = array_new(count, 2 * sizeof *values), most = 0, found[2];
    struct overlay_report overlay;
    if (!values)
        return nomem(a);
    for (uint32_t v = 0; v < a->level.vertex_count; v++)
        most = larger(most, bounds[v]);
    for (size_t i = 0; i < count; i++) {
        values[i] = field->values[i] + (most - bounds[i / components]);
        values[count + i] = field->values[i] - (most - bounds[i / components]);
    }
    double floor = largest_local(most, info->fields[bounded].range);
    struct point_field fields[2] = {*field, *field};
    struct tetmesh level = a->level;
    fields[0].values = values;
    fields[1].values = values + count;
    level.fields = fields;
    level.field_count = 2;
    options.floors = (const double[2]){floor, floor};
    enum tetlod_status status = overlay_max(a->original, original, &level, shifted, 2, &options, found, &overlay,
                                            a->error);
    free(values);
    if (status == TETLOD_OK && larger(found[0], found[1]) > floor)
        status = tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,
                              "level %u, %.60s: %.60s is off by %.3g more than it says somewhere", k,
                              info->fields[bound].name, info->fields[bounded].name, larger(found[0], found[1]) - most);
    return status;
}

/* Is the level the original but for values, and are these within the floors at every vertex? Then they are everywhere:
 * in each tetrahedron the difference is linear. */
static bool is_within_floors(const struct against *a)
{
    const struct tetmesh *original = a->original, *level = &a->level;
    size_t vertices = original->vertex_count, tets = original->tet_count;
    bool within = level->vertex_count == vertices && level->tet_count == tets &&
                  !memcmp(level->positions, original->positions, 3 * vertices * sizeof *level->positions) &&
                  !memcmp(level->corners, original->corners, 4 * tets * sizeof *level->corners);
    for (uint32_t f = 0; f < level->field_count && within; f++) {
        const struct point_field *here = &level->fields[f], *there = &original->fields[a->fields[f]];
        for (size_t i = 0; i < vertices * here->components && within; i++)
            within = fabs(here->values[i] - there->values[i]) <= a->floors[f];
    }
    return within;
}

static enum tetlod_status check_exact(struct against *a, uint32_t k, bool all)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    struct overlay_options options = {.threads = a->options->threads, .floors = a->floors, .overlaps = true,
                                      .clusters = &a->clusters, .neighbours = a->neighbours};
    struct overlay_report overlay;
    TETLOD_TRY(choose_tets(a, &options));
    if (!all)
        options.wanted = NULL;
    for (uint32_t f = 0; f < info->field_count; f++) {
        const double *range = info->fields[f].range;
        double certified = stored_error(info, k, f, TETLOD_MAX);
        bool looked_for = !isnan(certified) && range_has_scale(range);
        a->floors[f] = looked_for ? largest_difference(certified, range) : INFINITY;
    }
    bool within = is_within_floors(a);
    if (!within)
        TETLOD_TRY(overlay_max(a->original, a->fields, &a->level, a->level_fields, info->field_count, &options,
                               a->exact, &overlay, a->error));
    for (uint32_t f = 0; f < info->field_count && !within; f++)
        if (a->exact[f] > a->floors[f])
            return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,
                                "level %u, %.60s: certified is %.9g, but the exact maximum is %.9g", k,
                                info->fields[f].name, stored_error(info, k, f, TETLOD_MAX),
                                range_fraction(info->fields[f].range, a->exact[f]));
    for (uint32_t f = 0; f < info->field_count; f++)
        if (info->fields[f].bounds != TETLOD_NONE)
            TETLOD_TRY(check_local(a, k, f, options));
    return TETLOD_OK;
}

/* Is this one of the levels for the exact maximum? Level 0 always is. */
static bool is_spread(const struct tetlod_info *info, uint32_t k)
{
    uint32_t below = info->level_count - 1, count = below < AGAINST_MAX_EXACT ? below : AGAINST_MAX_EXACT;
    for (uint32_t i = 0; i < count; i++)
        if (k == (uint64_t)i * (below - 1) / (count > 1 ? count - 1 : 1))
            return true;
    return false;
}

static enum tetlod_status check_levels(struct against *a)
{
    const struct tetlod_info *info = tetlod_info(a->file);
    bool all = a->options->all_levels || (double)info->tets * info->level_count <= MAX_WORK;
    for (uint32_t k = info->level_count; k-- > 0;) {
        double domain;
        TETLOD_TRY(measure_this(a, k, &domain));
        TETLOD_TRY(adjacency_build(a->level.corners, a->level.tet_count, a->level.vertex_count, a->neighbours, NULL,
                                   a->error));
        TETLOD_TRY(check_sampled(a, k));
        TETLOD_TRY(check_order(a, k));
        TETLOD_TRY(check_domain(a, k, domain));
        a->report->measured += a->numbered;
        if (all || is_spread(info, k)) {
            if (!info->lossless || k + 1 < info->level_count) // the finest is the input
                TETLOD_TRY(check_exact(a, k, all));
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
    a->measured = array_new(info->field_count, sizeof *a->measured);
    a->ranges = array_new(info->field_count, sizeof *a->ranges);
    a->rounding = array_zero(info->field_count, sizeof *a->rounding);
    a->exact = array_new(info->field_count, sizeof *a->exact);
    a->floors = array_new(info->field_count, sizeof *a->floors);
    a->usable = array_new(info->tets, 1);
    a->wanted = array_new(info->tets, 1);
    a->neighbours = array_new(info->tets, 4 * sizeof *a->neighbours);
    a->report->exact = array_new(info->level_count, sizeof *a->report->exact);
    if (!a->fields || !a->level_fields || !a->measured || !a->ranges || !a->rounding || !a->exact || !a->floors ||
        !a->usable || !a->wanted || !a->neighbours ||
        !a->report->exact)
        return nomem(a);
    if (a->input->unused_points != info->unused_points)
        return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH, "the input has %llu unused points, the index says %llu",
                            (unsigned long long)a->input->unused_points, (unsigned long long)info->unused_points);
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
        if (info->fields[f].bounds == TETLOD_NONE && (range[0] != stored[0] || range[1] != stored[1]))
            return tetlodi_fail(a->error, TETLOD_ERR_MISMATCH,
                                "%.60s: the input's range is %g .. %g, stored is %g .. %g",
                                info->fields[f].name, range[0], range[1], stored[0], stored[1]);
    }
    return TETLOD_OK;
}

static void release(struct against *a)
{
    void *const owned[] = {a->parents, a->bodies,   a->touched, a->usable,       a->wanted, a->fields,
                           a->measured, a->ranges,   a->exact,   a->level_fields, a->floors, a->rounding,
                           a->neighbours};
    measure_levels_free(a->measure_levels);
    boundary_check_free(a->boundary);
    clusters_fini(&a->clusters);
    coarsening_fini(&a->coarsening);
    tetmesh_fini(&a->level);
    sheets_fini(&a->sheets);
    tetmesh_fini(&a->finest);
    tetmesh_fini(&a->renumbered);
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

enum tetlod_status against_check(const struct tetlod_file *file, struct tetlod_cursor *cursor,
                                 const struct tetmesh *input,
                                 const struct against_options *options, struct against_report *report,
                                 struct tetlod_error *error)
{
    struct against a = {.file = file, .cursor = cursor, .input = input, .options = options, .report = report,
                        .error = error};
    *report = (struct against_report){0};
    enum tetlod_status status = prepare(&a);
    if (status == TETLOD_OK)
        status = begin(&a);
    if (status == TETLOD_OK)
        status = check_levels(&a);
    release(&a);
    return status;
}
