/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a log, with the errors that contracting has proved. Levels that are asked for are measured, here, or by other
 * programs while this one codes. Out: the errors of every level, none less than those of a finer one.
 */
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/cells/border_help.h"
#include "src/log/coarsening.h"
#include "src/measure/measure_levels.h"
#include "src/measure/measure_shared.h"
#include "src/measure/overlay_levels.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/building.h"
#include "src/pipeline/quantise.h"
#include "src/simplify/ladder.h"
#include "src/util/array.h"

/* Exact maxima up to this fraction of the range are not looked for. */
static const double NO_DIFFERENCE = 1e-12;

/* Of fewer tetrahedra every level is measured: it takes a second or two. */
enum { MEASURED_WHOLE = 1 << 18 };

/* Of more, few: within errors up to the first; below the second, where levels take longest, within 0.01 % and so on. */
static const double LAST_NAME = 0.2, LAST_OF_TENS = 0.001;

/* The certified and the predicted error of a field at a mark, as fractions of the original's range: its worst
 * component's. NaN if it does not drive. */
static void mark_errors(const struct build *build, uint32_t mark, uint32_t field, double *errors)
{
    const struct contraction_log *log = &build->log;
    const double *range = build->ranges[field];
    errors[TETLOD_MAX] = errors[TETLOD_PREDICTED] = NAN;
    for (uint32_t d = 0; d < log->component_count; d++) {
        if (log->components[d].field != field)
            continue;
        size_t i = (size_t)mark * log->component_count + d;
        double rounding = build->rounding ? range_fraction(range,
                                                           build->rounding[field]) : 0, certified = log->certified[i];
        if (build->rounding && log->components[d].scale > 0) // is relative to the rounded field's range
            certified = range_fraction(range, certified / log->components[d].scale);
        if (build->precision.tail) // vertices that are left are rounded
            certified = larger(certified, range_fraction(range, build->precision.rounding[field]));
        errors[TETLOD_MAX] = fmax(errors[TETLOD_MAX], fmin(certified + rounding, 1));
        errors[TETLOD_PREDICTED] = fmax(errors[TETLOD_PREDICTED], log->predicted[i]);
    }
}

/* [field][measure] of the last level, whose values are the original's. */
static double *tail_errors(const struct build *build)
{
    return build->errors + (size_t)build->log.mark_count * build->mesh->field_count * TETLOD_MEASURES;
}

/* The next finer mark that is measured, or NULL: its errors of a field. */
static const double *finer_measured(const struct build *build, uint32_t mark, uint32_t field)
{
    while (mark > 0 && !build->asked[mark - 1])
        mark--;
    return mark ? build->errors + ((size_t)(mark - 1) * build->mesh->field_count + field) * TETLOD_MEASURES : NULL;
}

/* Fills one mark's errors, each no less than the finer mark's: a level promises that no finer one has a larger
 * error. `measured` NULL: it is not measured. */
static void file_errors(const struct build *build, uint32_t mark, const struct measured *measured)
{
    uint32_t fields = build->mesh->field_count;
    for (uint32_t f = 0; f < fields; f++) {
        double *errors = build->errors + ((size_t)mark * fields + f) * TETLOD_MEASURES;
        const double *finer = mark ? errors - fields * TETLOD_MEASURES : NULL, *range = build->ranges[f];
        const double *known = finer_measured(build, mark, f);
        if (!mark && build->precision.tail)
            finer = known = tail_errors(build) + (size_t)f * TETLOD_MEASURES;
        mark_errors(build, mark, f, errors);
        errors[TETLOD_SAMPLED] = measured ? range_fraction(range, measured[f].sampled) : NAN;
        errors[TETLOD_RMS] = measured ? range_fraction(range, measured[f].rms) : NAN;
        if (measured && build->precision.tail) { // what has not been contracted is not measured
            errors[TETLOD_SAMPLED] = larger(errors[TETLOD_SAMPLED],
                                            range_fraction(range, build->precision.rounding[f]));
            errors[TETLOD_RMS] = larger(errors[TETLOD_RMS], range_fraction(range, build->precision.rounding_rms[f]));
        }
        // where the boundary moved it is proved for another point than it is measured at (PROOF.md, 5)
        if (measured && !isnan(errors[TETLOD_MAX]))
            errors[TETLOD_MAX] = larger(errors[TETLOD_MAX], errors[TETLOD_SAMPLED]);
        for (int m = 0; m < TETLOD_MEASURES; m++) {
            const double *than = m == TETLOD_SAMPLED || m == TETLOD_RMS ? known : finer;
            errors[m] = isnan(errors[m]) || !than ? errors[m] : larger(errors[m], than[m]);
        }
    }
}

static enum tetlod_status find_ranges(struct build *build)
{
    const struct tetmesh *original = build->original;
    build->ranges = array_new(original->field_count, sizeof *build->ranges);
    if (!build->ranges)
        return tetlodi_fail_nomem(build->error, "the fields", original->field_count * sizeof *build->ranges);
    for (uint32_t f = 0; f < original->field_count; f++) {
        const struct grid *grid = &build->mesh->fields[f].grid;
        point_field_range(&original->fields[f], original->vertex_count, build->ranges[f]);
        if (build->options->local_bound && f >= build->bounds.first)
            build->ranges[f][1] = grid->origin + grid->step * grid->most;
    }
    return TETLOD_OK;
}


/* How far from the level's boundary the certified error need not hold at the same position (PROOF.md, 5): a point that
 * is further inside than the boundary moved is its own partner. Fields that are not controlled are certified nowhere;
 * the exact and the measured limit leave rounding out. */
static double unproved_reach(const struct build *build, uint32_t mark)
{
    const struct build_options *options = build->options;
    double moved = build->log.marks[mark].moved;
    if (options->certify_all || options->certify == CERTIFY_EXACT || options->metric == METRIC_MEASURED)
        return INFINITY;
    return moved > BOUNDARY_KEPT * build->diagonal ? (moved + build->rounded_by) * (1 + 1e-9) : 0;
}

/* The exact maximum of the current level, of the fields that are asked about, as far as it is above what finer ones
 * have come to and what the level is certified for in any case (less a hair, which taking fractions of the range may
 * add). */
static enum tetlod_status find_exact(struct build *build, const struct coarsening *coarsening, uint32_t mark)
{
    for (uint32_t f = 0; f < build->mesh->field_count; f++) {
        const double *range = build->ranges[f];
        double finer = NO_DIFFERENCE, own[TETLOD_MEASURES];
        if (mark)
            finer = larger(finer,
                           build->errors[((size_t)(mark - 1) * build->mesh->field_count + f) * TETLOD_MEASURES +
                                         TETLOD_MAX]);
        mark_errors(build, mark, f, own);
        finer = fmax(finer, own[TETLOD_MAX] * (1 - 4 * DBL_EPSILON));
        bool asked = range_has_scale(range) && (building_controls(build, f) || build->options->certify_all);
        build->exact[f] = asked ? finer * (range[1] - range[0]) : INFINITY;
    }
    return overlay_levels_next(build->overlay, coarsening, unproved_reach(build, mark), build->exact,
                               build->error);
}

/* `max` becomes no less than the exact maximum: where it is proved for another point than the one at the same place, or
 * not at all. */
static void raise_max(const struct build *build, uint32_t mark)
{
    for (uint32_t f = 0; f < build->mesh->field_count; f++) {
        double *errors = build->errors + ((size_t)mark * build->mesh->field_count + f) * TETLOD_MEASURES;
        const double *range = build->ranges[f];
        double exact = range_fraction(range, build->exact[f]);
        if (isfinite(build->exact[f]) && exact > NO_DIFFERENCE)
            errors[TETLOD_MAX] = fmax(errors[TETLOD_MAX], larger(exact, errors[TETLOD_SAMPLED]));
        else if (isnan(errors[TETLOD_MAX]) && build->options->certify_all &&
                 (range[0] == range[1] || range_has_scale(range)))
            errors[TETLOD_MAX] = errors[TETLOD_SAMPLED];
    }
}

/* The levels of a mark that has been measured, and of those before it that have not: their boundary has moved less. */
static void file_levels(struct build *build, uint32_t mark, const struct measured *measured, double domain)
{
    uint32_t first = mark;
    while (first > 0 && !build->asked[first - 1])
        first--;
    for (; first <= mark; first++) {
        file_errors(build, first, first == mark ? measured : NULL);
        if (build->overlay)
            raise_max(build, first);
        build->levels[build->log.mark_count - 1 - first].domain_error =
            build->diagonal > 0 ? domain / build->diagonal : 0;
    }
}

static enum tetlod_status measure_mark(struct build *build, struct coarsening *coarsening,
                                       struct measure_levels *measure, uint32_t mark, struct measured *measured)
{
    double domain = build->domains[mark];
    if (mark)
        TETLOD_TRY(coarsening_advance(coarsening, &build->log, build->log.marks[mark].contractions,
                                      build->options->threads, build->error));
    if (build->overlay)
        TETLOD_TRY(find_exact(build, coarsening, mark));
    TETLOD_TRY(measure_levels_next(measure, measured, &domain, build->error));
    file_levels(build, mark, measured, domain);
    return TETLOD_OK;
}

/* Is a mark's level the coarsest one within an error that has a name, up to the greatest that users look at, of some
 * field? */
static bool is_named(const struct build *build, uint32_t mark)
{
    for (uint32_t f = 0; f < build->mesh->field_count; f++) {
        double own[TETLOD_MEASURES], coarser[TETLOD_MEASURES];
        bool named;
        mark_errors(build, mark, f, own);
        mark_errors(build, mark + 1, f, coarser);
        double name = FIRST_LIMIT, tens = build->mesh->tet_count < MEASURED_WHOLE ? 0 : LAST_OF_TENS / 2;
        while (name < LAST_NAME && name * (1 + LIMIT_TIE) < own[TETLOD_MAX])
            name = name < tens ? 10 * name : next_limit(name, LAST_NAME, INFINITY, &named);
        if (own[TETLOD_MAX] <= name * (1 + LIMIT_TIE) && name * (1 + LIMIT_TIE) < coarser[TETLOD_MAX])
            return true;
    }
    return false;
}

/* Which marks are measured: all of a small mesh. Of a large one, and in pages, those where users look, with the finest
 * and the coarsest, if levels end at errors that are proved for all fields. Nobody asks how far ids are off. */
static void list_asked(const struct build *build)
{
    uint32_t marks = build->log.mark_count;
    bool all = (build->mesh->tet_count < MEASURED_WHOLE && !build->groups.count) ||
               !metric_is_certified(build->options->metric) || build_asks_overlay(build->options);
    for (uint32_t f = 0; f < build->mesh->field_count; f++)
        all |= !building_controls(build, f) && !build->mesh->fields[f].is_ids;
    for (uint32_t mark = 0; mark < marks; mark++)
        build->asked[mark] = all || !mark || mark + 1 == marks || is_named(build, mark);
}

/* The tail is the rounded mesh: its errors are what was measured, and what rounding came to over the overlay. */
static void file_tail(const struct build *build, const struct measured *measured)
{
    for (uint32_t f = 0; f < build->mesh->field_count; f++) {
        double *errors = tail_errors(build) + (size_t)f * TETLOD_MEASURES, *range = build->ranges[f];
        errors[TETLOD_SAMPLED] = range_fraction(range, measured[f].sampled);
        errors[TETLOD_RMS] = range_fraction(range, measured[f].rms);
        errors[TETLOD_MAX] = fmin(larger(range_fraction(range, build->rounding[f]), errors[TETLOD_SAMPLED]), 1);
    }
}

/* The last level, where positions are rounded, is measured as the others are: of a lossless stream nothing is left of
 * any error. */
static enum tetlod_status measure_tail(struct build *build, struct measured *measured)
{
    struct coarsening exact = {0};
    struct measure_levels *measure = NULL;
    double domain = build->rounded_by;
    enum tetlod_status status = TETLOD_OK;
    TETLOD_TRY_DONE(coarsening_init(&exact, &build->rounded, NULL, build->error));
    TETLOD_TRY_DONE(measure_levels_new(&measure, build->original, &exact, build->options->threads, build->error));
    TETLOD_TRY_DONE(measure_levels_next(measure, measured, &domain, build->error));
    build->levels[build->log.mark_count].domain_error = build->diagonal > 0 ? domain / build->diagonal : 0;
    file_tail(build, measured);
done:
    measure_levels_free(measure);
    coarsening_fini(&exact);
    return status;
}

/* What the level before the tail does not say, the tail does not. */
static void match_tail(struct build *build)
{
    for (uint32_t i = 0; i < build->mesh->field_count * TETLOD_MEASURES; i++)
        if (isnan(build->errors[i]))
            tail_errors(build)[i] = NAN;
}

static bool measure_progress(void *opaque, double done)
{
    const struct build *build = opaque;
    return !build->options->progress || build->options->progress(build->options->progress_opaque, BUILD_MEASURE, done);
}

/* One level after the other. */
static enum tetlod_status measure_alone(struct build *build, struct measured *measured)
{
    uint32_t marks = build->log.mark_count;
    struct coarsening coarsening = {0};
    struct measure_levels *measure = NULL;
    enum tetlod_status status = TETLOD_OK;
    TETLOD_TRY_DONE(coarsening_init(&coarsening, build->mesh, &build->log, build->error));
    TETLOD_TRY_DONE(measure_levels_new(&measure, build->original, &coarsening, build->options->threads, build->error));
    if (build_asks_overlay(build->options))
        TETLOD_TRY_DONE(overlay_levels_new(&build->overlay, build->original, &coarsening, build->options->threads,
                                           build->error));
    for (uint32_t mark = 0; mark < marks; mark++) {
        if (build->asked[mark])
            TETLOD_TRY_DONE(measure_mark(build, &coarsening, measure, mark, measured));
        TETLOD_TRY_DONE(build_say_done(build->options, BUILD_MEASURE, (mark + 1.0) / marks, build->error));
    }
done:
    measure_levels_free(measure);
    overlay_levels_free(build->overlay);
    coarsening_fini(&coarsening);
    return status;
}

/* The same by other programs, samples by parts. */
static enum tetlod_status measure_together(struct build *build)
{
    const struct build_options *options = build->options;
    const struct shared_levels levels = {
        build->original, build->mesh, &build->log, build->asked, build->domains, options->threads, options->share,
        border_kept(options->share, build->groups.count ? build->mesh : NULL), measure_progress, build};
    return measure_shared_begin(&build->measuring, &levels, build->error);
}

/* The levels without their errors. */
static void list_levels(const struct build *build)
{
    const uint32_t marks = build->log.mark_count;
    for (uint32_t mark = 0; mark < marks; mark++) {
        const struct log_mark *at = &build->log.marks[mark];
        build->domains[mark] = at->moved + build->rounded_by;
        build->levels[marks - 1 - mark] = (struct tetlodi_write_level){
            at->contractions, 0, build->errors + (size_t)mark * build->mesh->field_count * TETLOD_MEASURES};
    }
    if (build->precision.tail)
        build->levels[marks] = (struct tetlodi_write_level){0, 0, tail_errors(build)};
}

static enum tetlod_status make_room(struct build *build)
{
    const size_t marks = build->log.mark_count, fields = build->mesh->field_count;
    build->exact = array_new(fields, sizeof *build->exact);
    build->asked = array_new(marks, sizeof *build->asked);
    build->domains = array_new(marks, sizeof *build->domains);
    build->levels = array_new(marks + 1, sizeof *build->levels);
    build->errors = array_zero((marks + 1) * fields, TETLOD_MEASURES * sizeof(double));
    bool room = build->exact && build->asked && build->domains && build->levels && build->errors;
    return room ? TETLOD_OK : tetlodi_fail_nomem(build->error, "the levels", marks * fields * 32);
}

enum tetlod_status level_errors_begin(struct build *build)
{
    bool writes = build_writes(build->options), shares = build->options->share && !build_asks_overlay(build->options);
    TETLOD_TRY(find_ranges(build));
    TETLOD_TRY(make_room(build));
    build->diagonal = smaller(mesh_diagonal(build->original), mesh_diagonal(build->mesh)); // streams have that
    list_levels(build);
    struct measured *measured = array_new(build->mesh->field_count, sizeof *measured);
    enum tetlod_status status = TETLOD_OK;
    if (!measured)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(build->error, "the levels", build->mesh->field_count * sizeof *measured));
    if (build->precision.tail && build->rounding && writes)
        TETLOD_TRY_DONE(measure_tail(build, measured));
    list_asked(build);
    if (shares)
        TETLOD_TRY_DONE(measure_together(build));
    else if (writes)
        TETLOD_TRY_DONE(measure_alone(build, measured));
    if (build->precision.tail && writes && !shares)
        match_tail(build);
done:
    free(measured);
    return status;
}

enum tetlod_status level_errors_end(void *opaque, struct tetlod_error *error)
{
    struct build *build = opaque;
    const uint32_t marks = build->log.mark_count, fields = build->mesh->field_count;
    if (!build->measuring)
        return TETLOD_OK;
    struct measured *measured = array_new((size_t)marks * fields, sizeof *measured);
    if (!measured)
        return tetlodi_fail_nomem(error, "the levels", (uint64_t)marks * fields * sizeof *measured);
    enum tetlod_status status = measure_shared_end(build->measuring, measured, build->domains, error);
    for (uint32_t mark = 0; mark < marks && status == TETLOD_OK; mark++)
        if (build->asked[mark])
            file_levels(build, mark, measured + (size_t)mark * fields, build->domains[mark]);
    if (build->precision.tail)
        match_tail(build);
    free(measured);
    return status;
}

void level_errors_fini(struct build *build)
{
    measure_shared_free(build->measuring);
    free(build->exact);
    free(build->asked);
    free(build->domains);
    free(build->ranges);
    free(build->levels);
    free(build->errors);
}
