/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/write/writer.h"
#include "src/measure/measure.h"
#include "src/mesh/ids.h"
#include "src/mesh/originals.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/build_memory.h"
#include "src/pipeline/building.h"
#include "src/pipeline/cell_types.h"
#include "src/pipeline/limits.h"
#include "src/pipeline/make_box_sums.h"
#include "src/pipeline/make_summary.h"
#include "src/pipeline/share_pages.h"
#include "src/util/array.h"
#include "src/util/json_text.h"

/* How far the boundary may move where the limit speaks of one domain, as a fraction of the diagonal: the exact limit
 * (PROOF.md, 8), and the true error at samples, which are to stay inside. */
static const double BOUNDARY_OF_EXACT = 1e-6;

static bool contract_progress(void *opaque, double done)
{
    const struct build *build = opaque;
    return build->options->progress(build->options->progress_opaque, BUILD_CONTRACT, done);
}

/* An error is a fraction of the range: one that overflows, or whose reciprocal does, would hide every error (PROOF.md,
 * 7). */
static enum tetlod_status check_ranges(const struct build *build)
{
    for (uint32_t f = 0; f < build->mesh->field_count; f++) {
        const struct point_field *field = &build->mesh->fields[f];
        double range[2];
        point_field_range(field, build->mesh->vertex_count, range);
        bool narrow = range[1] > range[0] && !range_has_scale(range) && building_controls(build, f);
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


/* A component that drives as a field of its own is also in its vector: there its values are the same ones. */
static void copy_components(struct build *build)
{
    const struct tetmesh *mesh = build->mesh;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        uint32_t component, vector = build_control_source(build->original, f, &component);
        if (vector == TETLOD_NONE || component == TETLOD_NONE || building_controls(build, vector))
            continue;
        const struct point_field *to = &mesh->fields[vector];
        for (size_t c = 0; c < build->log.count; c++)
            build->log.fields[vector].values[c * to->components + component] =
                grid_round(&to->grid, to->type, build->log.fields[f].values[c]);
    }
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
                                      .controlled = building_controls(build, f),
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
                                        .measured = level_errors_end,
                                        .measured_opaque = build,
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
    TETLOD_TRY_DONE(build_say_done(options, BUILD_MEASURE, 0, error));
    TETLOD_TRY_DONE(level_errors_begin(&build));
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
    level_errors_fini(&build);
    return status;
}
