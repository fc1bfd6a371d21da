/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/build.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/write/writer.h"
#include "src/cells/border_help.h"
#include "src/cells/cell_phases.h"
#include "src/log/coarsening.h"
#include "src/measure/measure_levels.h"
#include "src/measure/measure_shared.h"
#include "src/measure/overlay_levels.h"
#include "src/mesh/ids.h"
#include "src/mesh/originals.h"
#include "src/mesh/orient.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/build_memory.h"
#include "src/pipeline/build_series.h"
#include "src/pipeline/cell_types.h"
#include "src/pipeline/keep_features.h"
#include "src/pipeline/limits.h"
#include "src/pipeline/local_bound.h"
#include "src/pipeline/precision.h"
#include "src/pipeline/make_box_sums.h"
#include "src/pipeline/make_summary.h"
#include "src/pipeline/share_pages.h"
#include "src/simplify/ladder.h"
#include "src/util/array.h"
#include "src/util/json_text.h"
#include "src/util/parallel.h"

/* How far the boundary may move while it counts as kept, as a fraction of the diagonal: by rounding, and where the
 * limit speaks of one domain: the exact one (PROOF.md, 8), and the true error at samples, which are to stay inside. */
static const double BOUNDARY_KEPT = 1e-12, BOUNDARY_OF_EXACT = 1e-6;

/* Exact maxima up to this fraction of the range are not looked for. */
static const double NO_DIFFERENCE = 1e-12;

/* Of fewer tetrahedra every level is measured: it takes a second or two. */
enum { MEASURED_WHOLE = 1 << 18 };

/* Of more, few: within errors up to the first; below the second, where levels take longest, within 0.01 % and so on. */
static const double LAST_NAME = 0.2, LAST_OF_TENS = 0.001;

struct build {
    const struct tetmesh *mesh;     /* that is contracted: rounded, if quantised. Levels have its values on its grids */
    const struct tetmesh *original; /* that errors are about */
    const uint32_t *numbering;      /* the corners as the caller numbers them: what is stored */
    const struct tetmesh *input;    /* with the cells that were split, if these are kept */
    struct oriented oriented;       /* `mesh` and `original` are in one turn (orient.h) */
    struct tetmesh turned;          /* the caller's mesh with those corners, if they differ */
    struct tetmesh rounded;
    double *rounding;               /* [field] bound of what rounding changed, if quantised */
    double rounded_by;              /* how far rounding has moved the boundary, in units of length */
    struct precision precision;     /* if fields are not */
    struct local_bounds bounds;     /* if they are asked for: `original` has them once the mesh is contracted */
    double (*ranges)[2];            /* [field] of the original; of a local bound 0 to the largest */
    const struct build_options *options;
    struct contraction_log log;
    struct cell_groups groups;      /* of a paged stream, fine to coarse */
    struct series_build *series;    /* if there is one */
    struct kept_features kept;      /* if they are asked for */
    struct tetlodi_write_level *levels; /* coarse to fine */
    double *errors;                     /* [mark][field][measure], fine to coarse */
    struct overlay_levels *overlay;     /* if it is asked for */
    struct field_cost cost;
    double *exact;                      /* [field] its answer at the current mark */
    bool *asked;                        /* [mark] it is measured (list_asked) */
    double diagonal;                    /* that the stream knows */
    struct tetlod_error *error;
};

static bool contract_progress(void *opaque, double done)
{
    const struct build *build = opaque;
    return build->options->progress(build->options->progress_opaque, BUILD_CONTRACT, done);
}

static bool is_controlled(const struct build *build, uint32_t field)
{
    for (uint32_t i = 0; i < build->options->control_count; i++)
        if (build->options->controls[i].field == field)
            return true;
    return false;
}

/* An error is a fraction of the range: one that overflows, or whose reciprocal does, would hide every error (PROOF.md,
 * 7). */
static enum tetlod_status check_ranges(const struct build *build)
{
    for (uint32_t f = 0; f < build->mesh->field_count; f++) {
        const struct point_field *field = &build->mesh->fields[f];
        double range[2];
        point_field_range(field, build->mesh->vertex_count, range);
        bool narrow = range[1] > range[0] && !range_has_scale(range) && is_controlled(build, f);
        if (narrow || !isfinite(range[1] - range[0]))
            return tetlodi_fail(build->error, TETLOD_ERR_MESH,
                                "field '%.60s' has the range %g .. %g, too %s for errors relative to it; scale its "
                                "values",
                                field->name, range[0], range[1], range[1] - range[0] > 1 ? "wide" : "narrow");
    }
    return TETLOD_OK;
}

/* The regions' numbers, or NULL. */
static const double *regions_of(const struct build *build)
{
    const char *name = build->options->regions;
    uint32_t field = name ? tetmesh_find_cell_field(build->original, name) : TETLOD_NONE;
    return field == TETLOD_NONE ? NULL : build->original->cell_fields[field].values;
}

/* Can it be found which field costs most? It takes the default's bounds, and memory that --memory may not allow. */
static bool finds_cost(const struct build_options *options)
{
    bool own_limits = false;
    for (uint32_t i = 0; i < options->control_count; i++)
        own_limits |= options->controls[i].limit > 0 || options->controls[i].share > 0;
    return options->finds_cost && options->control_count > 1 && !own_limits && !options->series && !options->memory &&
           options->metric == METRIC_ENVELOPE && options->certify == CERTIFY_FAST &&
           options->contract == CONTRACT_EDGES && options->max_error >= FIELD_COST_ERROR;
}

static enum tetlod_status contract(struct build *build)
{
    const struct build_options *options = build->options;
    struct limits limits;
    TETLOD_TRY(limits_set(&limits, options, build->original, build->rounding, build->error));
    double domain_error = larger(options->domain_error, BOUNDARY_KEPT);
    if (options->certify == CERTIFY_EXACT || options->metric == METRIC_MEASURED)
        domain_error = smaller(domain_error, BOUNDARY_OF_EXACT);
    struct simplify_options simplify_options = {
        .metric = options->metric,
        .certify = options->certify,
        .contract = options->contract,
        .max_error = limits.max_error,
        .min_tets = options->min_tets,
        .boundary_angle = options->boundary_angle,
        .boundary_limit = domain_error * mesh_diagonal(build->original),
        .boundary_least = BOUNDARY_KEPT * mesh_diagonal(build->original),
        .regions = regions_of(build),
        .fixed = build->kept.fixed,
        .local_bound = options->local_bound || finds_cost(options),
        .growth = options->growth,
        .threads = options->threads,
        .progress = options->progress ? contract_progress : NULL,
        .progress_opaque = build,
    };
    const struct cell_choice cells = {options->paged, options->bands, options->spools, options->share};
    const char *wrong = options->paged ? build_against_pages(options) : NULL;
    enum tetlod_status status;
    if (wrong)
        status = tetlodi_fail(build->error, TETLOD_ERR_ARGUMENT, "--paged: %s", wrong);
    else if (options->paged)
        status = cells_simplify(&build->log, &build->groups, build->mesh, limits.fields, options->control_count,
                                limits.weights, &cells, &simplify_options, build->error);
    else if (build->series)
        status = series_contract(build->series, &build->log, build->mesh, limits.weights, &simplify_options,
                                 build->error);
    else
        status = simplify(&build->log, build->mesh, limits.fields, options->control_count, limits.weights,
                          &simplify_options, build->error);
    if (status == TETLOD_OK && finds_cost(options))
        status = field_cost_find(&build->cost, build->mesh, &build->log, limits.fields, options->control_count,
                                 &simplify_options, build->error);
    limits_fini(&limits);
    return status;
}

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

/* A component that drives as a field of its own is also in its vector: there its values are the same ones. */
static void copy_components(struct build *build)
{
    const struct tetmesh *mesh = build->mesh;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        uint32_t component, vector = build_control_source(build->original, f, &component);
        if (vector == TETLOD_NONE || component == TETLOD_NONE || is_controlled(build, vector))
            continue;
        const struct point_field *to = &mesh->fields[vector];
        for (size_t c = 0; c < build->log.count; c++)
            build->log.fields[vector].values[c * to->components + component] =
                grid_round(&to->grid, to->type, build->log.fields[f].values[c]);
    }
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
        bool asked = range_has_scale(range) && (is_controlled(build, f) || build->options->certify_all);
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
        build->levels[build->log.mark_count - 1 - first] = (struct tetlodi_write_level){
            build->log.marks[first].contractions, build->diagonal > 0 ? domain / build->diagonal : 0,
            build->errors + (size_t)first * build->mesh->field_count * TETLOD_MEASURES};
    }
}

static enum tetlod_status measure_mark(struct build *build, struct coarsening *coarsening,
                                       struct measure_levels *measure, uint32_t mark, struct measured *measured)
{
    const struct log_mark *at = &build->log.marks[mark];
    double domain = at->moved + build->rounded_by;
    if (mark)
        TETLOD_TRY(coarsening_advance(coarsening, &build->log, at->contractions, build->options->threads,
                                      build->error));
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
 * and the coarsest, if levels end at errors that are proved for all fields. */
static void list_asked(const struct build *build)
{
    uint32_t marks = build->log.mark_count;
    bool all = (build->mesh->tet_count < MEASURED_WHOLE && !build->groups.count) ||
               !metric_is_certified(build->options->metric) || build_asks_overlay(build->options);
    for (uint32_t f = 0; f < build->mesh->field_count; f++)
        all |= !is_controlled(build, f);
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

/* The last level: of a lossless stream nothing is left of any error. Else its positions are rounded, and it is measured
 * as the others are. */
static enum tetlod_status measure_tail(struct build *build, struct measured *measured)
{
    struct coarsening exact = {0};
    struct measure_levels *measure = NULL;
    double *errors = tail_errors(build), domain = build->rounded_by;
    enum tetlod_status status = TETLOD_OK;
    build->levels[build->log.mark_count] = (struct tetlodi_write_level){0, 0, errors};
    if (!build->rounding || !build_writes(build->options))
        return TETLOD_OK;
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

/* The same with other programs, samples by parts. */
static enum tetlod_status measure_together(struct build *build)
{
    uint32_t marks = build->log.mark_count, fields = build->mesh->field_count;
    struct measured *measured = array_new((size_t)marks * fields, sizeof *measured);
    double *domains = array_new(marks, sizeof *domains);
    const struct build_options *options = build->options;
    const struct kept_mesh kept = border_kept(options->share, build->groups.count ? build->mesh : NULL);
    const struct shared_levels levels = {build->original, build->mesh, &build->log, build->asked, domains,
                                         options->threads, options->share, &kept, measure_progress, build};
    enum tetlod_status status = TETLOD_OK;
    if (!measured || !domains)
        status = tetlodi_fail_nomem(build->error, "the levels", (uint64_t)marks * fields * 32);
    for (uint32_t mark = 0; mark < marks && status == TETLOD_OK; mark++)
        domains[mark] = build->log.marks[mark].moved + build->rounded_by;
    if (status == TETLOD_OK)
        status = measure_shared(&levels, measured, domains, build->error);
    for (uint32_t mark = 0; mark < marks && status == TETLOD_OK && build_writes(build->options); mark++)
        if (build->asked[mark])
            file_levels(build, mark, measured + (size_t)mark * fields, domains[mark]);
    free(measured);
    free(domains);
    return status;
}

static enum tetlod_status measure_marks(struct build *build)
{
    uint32_t marks = build->log.mark_count, fields = build->mesh->field_count;
    bool shares = build->options->share && !build_asks_overlay(build->options);
    struct measured *measured = array_new(fields, sizeof *measured);
    build->exact = array_new(fields, sizeof *build->exact);
    build->asked = array_new(marks, sizeof *build->asked);
    build->diagonal = smaller(mesh_diagonal(build->original), mesh_diagonal(build->mesh)); // streams have that
    enum tetlod_status status = TETLOD_OK;
    build->levels = array_new(marks + (size_t)1, sizeof *build->levels);
    build->errors = array_zero((marks + (size_t)1) * fields, TETLOD_MEASURES * sizeof(double));
    if (!measured || !build->exact || !build->asked || !build->levels || !build->errors)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(build->error, "the levels", (uint64_t)marks * fields * 32));
    if (build->precision.tail)
        TETLOD_TRY_DONE(measure_tail(build, measured));
    list_asked(build);
    if (shares)
        TETLOD_TRY_DONE(measure_together(build));
    else if (build_writes(build->options))
        TETLOD_TRY_DONE(measure_alone(build, measured));
    for (uint32_t mark = 0; mark < marks && !build_writes(build->options); mark++)
        if (build->asked[mark]) // pages do not say how far their level is off
            file_levels(build, mark, NULL, 0);
    if (build->precision.tail && build_writes(build->options))
        match_tail(build);
done:
    free(build->exact);
    free(build->asked);
    free(measured);
    return status;
}

/* A field of a series has the type that holds it at every step. */
static enum tetlod_cell_type stored_cell_type(const struct build_series *series, const struct tetmesh *mesh,
                                              uint32_t field)
{
    for (uint32_t c = 0; series && c < series->cell_count; c++)
        if (series->cells[c].field == field)
            return series->cells[c].type;
    return cell_type_of(&mesh->cell_fields[field], mesh->tet_count);
}

/* The fields of cells as they are stored; rounded ones are in `rounded`, to be freed after *out. */
static enum tetlod_status list_cells(const struct build *build, struct tetlodi_write_cells **out,
                                     struct rounded_cells **rounded)
{
    const struct tetmesh *mesh = build->original;
    const struct build_options *options = build->options;
    bool *ids = array_zero(mesh->cell_field_count, sizeof *ids);
    *out = array_zero(mesh->cell_field_count, sizeof **out);
    *rounded = array_zero(mesh->cell_field_count, sizeof **rounded);
    enum tetlod_status status = TETLOD_OK;
    if (!ids || !*out || !*rounded)
        status = tetlodi_fail_nomem(build->error, "the fields", mesh->cell_field_count * sizeof **out);
    if (status == TETLOD_OK)
        ids_find(mesh->cell_fields, mesh->cell_field_count, mesh->tet_count, ids);
    for (uint32_t f = 0; f < mesh->cell_field_count && status == TETLOD_OK; f++) {
        const struct point_field *field = &mesh->cell_fields[f];
        enum tetlod_cell_type type = stored_cell_type(options->series, mesh, f);
        bool is_region = options->regions && strcmp(options->regions, field->name) == 0;
        if (type <= TETLOD_CELL_FLOAT64 && !is_region && !ids[f])
            status = quantise_cells(field, mesh->tet_count, type == TETLOD_CELL_FLOAT32, &options->quantise,
                                    &(*rounded)[f], build->error);
        const double *values = (*rounded)[f].values;
        (*out)[f] = (struct tetlodi_write_cells){.name = field->name,
                                                 .components = field->components,
                                                 .type = type,
                                                 .region = is_region,
                                                 .values = values ? values : field->values,
                                                 .quantum = values ? (*rounded)[f].quantum : 0,
                                                 .error = values ? (*rounded)[f].error : 0};
    }
    free(ids);
    return status;
}

static struct tetlodi_write_field list_field(const struct build *build, uint32_t f)
{
    const struct point_field *field = &build->mesh->fields[f], *original = &build->original->fields[f];
    bool is_exact_later = build->precision.tail && field->grid.bits;
    struct tetlodi_write_field out = {.name = field->name,
                                      .components = field->components,
                                      .type = field->type,
                                      .was_float64 = original->type != field->type,
                                      .controlled = is_controlled(build, f),
                                      .local_bound = build->options->local_bound && f >= build->bounds.first,
                                      .values = is_exact_later ? NULL : field->values,
                                      .exact = is_exact_later ? field->values : NULL,
                                      .node_values = build->log.fields[f].values,
                                      .bits = field->grid.bits,
                                      .origin = field->grid.origin,
                                      .step = field->grid.step,
                                      .most = (int64_t)field->grid.most};
    memcpy(out.range, build->ranges[f], sizeof out.range);
    return out;
}

/* Of a series the steps follow, which report the second half. */
static int encode_progress(void *opaque, double done)
{
    const struct build *build = opaque;
    return build->options->progress(build->options->progress_opaque, BUILD_ENCODE, build->series ? done / 2 : done);
}

/* From fine to coarse, as they were made, to coarse to fine, as they are stored. */
static void reverse_groups(struct cell_groups *groups)
{
    for (uint32_t i = 0; i < groups->count / 2; i++) {
        struct tetlodi_write_group swap = groups->groups[i];
        groups->groups[i] = groups->groups[groups->count - 1 - i];
        groups->groups[groups->count - 1 - i] = swap;
    }
}

/* The sections of the options, the cells that were split if they are kept, and the sums if they are asked for; *bytes
 * and *originals are to be freed after *out. */
static enum tetlod_status list_sections(struct build *build, struct tetlodi_buffer *bytes, unsigned char **originals,
                                        struct tetlodi_write_section **out, uint32_t *count)
{
    const struct build_options *options = build->options;
    struct tetlodi_summary summary;
    struct tetlodi_box_sums boxes;
    *count = options->section_count;
    *out = array_new(*count + (size_t)3, sizeof **out);
    if (!*out)
        return tetlodi_fail_nomem(build->error, "the sections", (*count + 3) * sizeof **out);
    if (*count)
        memcpy(*out, options->sections, *count * sizeof **out);
    if (options->keep_order && build->input->cells) {
        struct tetlodi_write_section section = {.tag = TAG_ORIGINALS, .row = ORIGINALS_ROW};
        TETLOD_TRY(originals_encode(build->input, originals, &section.size, build->error));
        section.bytes = *originals;
        (*out)[(*count)++] = section;
    }
    if (!options->summary)
        return TETLOD_OK;
    TETLOD_TRY(summary_make(&summary, build->original, build->mesh, &build->log,
                            build->log.mark_count + build->precision.tail, build->error));
    tetlodi_summary_encode(&summary, bytes);
    const uint32_t row = 64 + 16 * summary.threshold_count;
    const size_t size = bytes->size;
    tetlodi_summary_fini(&summary);
    TETLOD_TRY(box_sums_make(&boxes, build->original, regions_of(build), row, build->error));
    tetlodi_box_sums_encode(&boxes, bytes);
    tetlodi_box_sums_fini(&boxes);
    if (bytes->failed)
        return tetlodi_fail_nomem(build->error, "the sums of the fields", bytes->size);
    (*out)[(*count)++] = (struct tetlodi_write_section){.tag = TAG_SUMMARY, .early = 1, .bytes = bytes->bytes,
                                                        .size = size};
    (*out)[(*count)++] = (struct tetlodi_write_section){.tag = TAG_BOX_SUMS, .early = 1, .bytes = bytes->bytes + size,
                                                        .size = bytes->size - size};
    return TETLOD_OK;
}

/* Of one that leads and does not write there is no sink: it has a part in coding the pages. */
static enum tetlod_status encode(struct build *build, const struct tetlodi_sink *sink)
{
    const struct tetmesh *mesh = build->mesh;
    const struct contraction_log *log = &build->log;
    struct tetlodi_write_field *fields = array_new(mesh->field_count, sizeof *fields);
    struct tetlodi_write_cells *cells = NULL;
    struct rounded_cells *rounded = NULL;
    struct tetlodi_buffer sums = {0};
    struct tetlodi_write_section *sections = NULL;
    unsigned char *originals = NULL;
    uint32_t section_count = 0;
    struct page_sharing sharing = {build->options->share, build->options->threads};
    enum tetlod_status status;
    if (!fields)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(build->error, "the fields", mesh->field_count * sizeof *fields));
    TETLOD_TRY_DONE(list_cells(build, &cells, &rounded));
    if (sink)
        TETLOD_TRY_DONE(list_sections(build, &sums, &originals, &sections, &section_count));
    for (uint32_t f = 0; f < mesh->field_count; f++)
        fields[f] = list_field(build, f);
    reverse_groups(&build->groups);
    struct tetlodi_write_input input = {.vertices = mesh->vertex_count,
                                        .tets = mesh->tet_count,
                                        .contractions = log->count,
                                        .position_type = mesh->position_type,
                                        .positions_were_float64 = build->original->position_type != mesh->position_type,
                                        .positions = mesh->positions,
                                        .corners = build->numbering,
                                        .children = log->children,
                                        .node_positions = log->positions,
                                        .field_count = mesh->field_count,
                                        .level_count = build->log.mark_count + build->precision.tail,
                                        .fields = fields,
                                        .levels = build->levels,
                                        .group_count = build->groups.count,
                                        .groups = build->groups.groups,
                                        .degenerate_tets = log->degenerate_tets,
                                        .inverted_tets = log->inverted_tets + log->folded_tets,
                                        .unused_points = mesh->unused_points,
                                        .metadata = build->options->metadata,
                                        .compression = build->options->compression,
                                        .keep_order = build->options->keep_order,
                                        .section_count = section_count,
                                        .sections = sections,
                                        .cell_field_count = build->original->cell_field_count,
                                        .cells = cells,
                                        .parents = build->input->parents,
                                        .late = build->series ? series_sections : NULL,
                                        .late_opaque = build->series,
                                        .share = sharing.share ? pages_share : NULL,
                                        .share_opaque = &sharing,
                                        .threads = build->options->threads,
                                        .progress = build->options->progress ? encode_progress : NULL,
                                        .progress_opaque = build};
    input.position_bits = mesh->position_grid[0].bits;
    for (int i = 0; i < 3; i++) {
        input.position_origin[i] = mesh->position_grid[i].origin;
        input.position_step[i] = mesh->position_grid[i].step;
    }
    status = tetlodi_write(&input, sink, build->error);
done:
    tetlodi_buffer_fini(&sums);
    free(originals);
    free(sections);
    free(fields);
    for (uint32_t f = 0; rounded && f < build->original->cell_field_count; f++)
        free(rounded[f].values);
    free(rounded);
    free(cells);
    return status;
}

/* Chooses what the levels' numbers are. */
static enum tetlod_status fit_precision(struct build *build)
{
    TETLOD_TRY(precision_init(&build->precision, build->mesh, build->error));
    build->mesh = &build->precision.mesh;
    return TETLOD_OK;
}

/* Why there can be no local bounds, or NULL. Where `max` is the exact maximum at the same position, nodes' bounds do
 * not hold it. */
static const char *against_local_bound(const struct build_options *options)
{
    if (options->certify == CERTIFY_EXACT || options->metric == METRIC_MEASURED)
        return "--certify exact and --metric measured carry no bound along";
    if (quantise_wanted(&options->quantise))
        return "it is of lossless builds, without rounding (--field-bits, --for mail and the like)";
    if (options->domain_error > DOMAIN_ERROR_SMALL)
        return "it is certified for a --domain-error of 0.001 at most";
    return options->series ? "it is of one step in time; --time N builds one" : NULL;
}

static enum tetlod_status check_local_bound(const struct build *build)
{
    const char *why = build->options->local_bound ? against_local_bound(build->options) : NULL;
    if (why)
        return tetlodi_fail(build->error, TETLOD_ERR_ARGUMENT, "--local-bound: %s", why);
    for (uint32_t i = 0; i < build->options->control_count && build->options->local_bound; i++)
        TETLOD_TRY(local_bound_check(build->original, build->options->controls[i].field, build->error));
    return TETLOD_OK;
}

static enum tetlod_status add_local_bounds(struct build *build)
{
    TETLOD_TRY(local_bounds_add(&build->bounds, build->original, &build->precision, &build->log, build->error));
    build->original = &build->bounds.original;
    return TETLOD_OK;
}

/* What the writer would refuse after the contraction is refused before it. */
static enum tetlod_status check_written(const struct tetmesh *mesh, const struct build_options *options,
                                        struct tetlod_error *error)
{
    uint32_t fields = mesh->field_count + (options->local_bound ? options->control_count : 0);
    const char *wrong = tetlodi_field_count_wrong(fields, mesh->cell_field_count);
    for (uint32_t f = 0; f < mesh->field_count && !wrong; f++)
        wrong = tetlodi_field_wrong(mesh->fields[f].name, mesh->fields[f].components);
    for (uint32_t f = 0; f < mesh->cell_field_count && !wrong; f++)
        wrong = tetlodi_field_wrong(mesh->cell_fields[f].name, mesh->cell_fields[f].components);
    if (wrong)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "the mesh cannot be stored: %s", wrong);
    wrong = tetlodi_metadata_wrong(options->metadata);
    if (!wrong && !json_text_is_object(options->metadata, strlen(options->metadata)))
        wrong = "it is not a JSON object in UTF-8";
    return wrong ? tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "the metadata cannot be stored: %s", wrong) : TETLOD_OK;
}

/* Rounds a copy of the mesh, to be contracted in its place. */
static enum tetlod_status quantise(struct build *build)
{
    TETLOD_TRY(quantise_mesh(&build->rounded, build->mesh, &build->options->quantise, build->error));
    build->mesh = &build->rounded;
    build->rounding = array_new(build->mesh->field_count, sizeof *build->rounding);
    if (!build->rounding)
        return tetlodi_fail_nomem(build->error, "the fields", build->mesh->field_count * sizeof *build->rounding);
    build->rounded_by = quantise_moved(build->mesh, build->original);
    return quantise_bounds(build->mesh, build->original, build->options->threads, build->rounding, build->error);
}

/* Contraction and errors are about orientation, what is stored about numbering. */
static enum tetlod_status orient_mesh(struct build *build, const struct tetmesh *mesh)
{
    TETLOD_TRY(orient(&build->oriented, mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, NULL,
                      build->error));
    if (!build->oriented.corners)
        return TETLOD_OK;
    build->turned = *mesh; // borrows all the rest
    build->turned.corners = build->oriented.corners;
    build->mesh = build->original = &build->turned;
    return TETLOD_OK;
}

/* Tetrahedra that are joined at faces have fewer points than that; files of discontinuous values have one for each
 * corner. */
static uint64_t count_loose(const struct tetmesh *mesh)
{
    enum { FEW = 8 };
    return mesh->tet_count >= FEW && mesh->vertex_count >= 2 * (uint64_t)mesh->tet_count ? mesh->tet_count : 0;
}

enum tetlod_status build_stream(const struct tetmesh *mesh, const struct build_options *options,
                                const struct tetlodi_sink *sink, struct build_report *report,
                                struct tetlod_error *error)
{
    struct build build = {.mesh = mesh, .original = mesh, .input = mesh,
                          .numbering = mesh->corners, .options = options,
                          .cost = {.field = TETLOD_NONE},
                          .error = error};
    enum tetlod_status status;
    TETLOD_TRY_DONE(check_local_bound(&build));
    TETLOD_TRY_DONE(check_written(mesh, options, error));
    TETLOD_TRY_DONE(build_check_memory(mesh, options, error));
    TETLOD_TRY_DONE(orient_mesh(&build, mesh));
    if (quantise_wanted(&options->quantise))
        TETLOD_TRY_DONE(quantise(&build));
    if (!quantise_rounds_fields(&options->quantise))
        TETLOD_TRY_DONE(fit_precision(&build));
    TETLOD_TRY_DONE(check_ranges(&build));
    if (options->series)
        TETLOD_TRY_DONE(series_new(&build.series, build.mesh, options, error));
    if (options->keep_features > 0)
        TETLOD_TRY_DONE(kept_features_init(&build.kept, build.original, options, error));
    TETLOD_TRY_DONE(contract(&build));
    if (options->keep_features > 0)
        TETLOD_TRY_DONE(kept_features_filter(&build.kept, build.mesh, &build.log, error));
    copy_components(&build);
    if (options->local_bound)
        TETLOD_TRY_DONE(add_local_bounds(&build));
    TETLOD_TRY_DONE(find_ranges(&build));
    TETLOD_TRY_DONE(build_say_done(options, BUILD_MEASURE, 0, error));
    TETLOD_TRY_DONE(measure_marks(&build));
    TETLOD_TRY_DONE(build_say_done(options, BUILD_ENCODE, 0, error));
    if (build_writes(options) || build.groups.count)
        TETLOD_TRY_DONE(encode(&build, build_writes(options) ? sink : NULL));
    *report = (struct build_report){.contractions = build.log.count,
                                    .levels = build.log.mark_count + build.precision.tail,
                                    .turned_tets = build.oriented.turned_count,
                                    .loose_tets = count_loose(mesh),
                                    .degenerate_tets = build.log.degenerate_tets,
                                    .inverted_tets = build.log.inverted_tets,
                                    .folded_tets = build.log.folded_tets,
                                    .cost = build.cost};
    memcpy(report->refused, build.log.refused, sizeof report->refused);
    report->keys = build.series ? series_key_count(build.series) : 0;
done:
    series_free(build.series);
    kept_features_fini(&build.kept);
    log_fini(&build.log);
    cell_groups_fini(&build.groups);
    tetmesh_fini(&build.rounded);
    oriented_fini(&build.oriented);
    local_bounds_fini(&build.bounds);
    precision_fini(&build.precision);
    free(build.rounding);
    free(build.ranges);
    free(build.levels);
    free(build.errors);
    return status;
}
