/* SPDX-License-Identifier: BSD-3-Clause */
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/cli/build_notes.h"
#include "src/cli/build_request.h"
#include "src/cli/carry.h"
#include "src/cli/mail.h"
#include "src/cli/scratch_memory.h"
#include "src/cli/show.h"
#include "src/mesh/ids.h"
#include "src/mesh/space_order.h"
#include "src/pipeline/build_helper.h"
#include "src/pipeline/build_memory.h"
#include "src/pipeline/field_choice.h"
#include "src/pipeline/local_bound.h"
#include "src/pipeline/topology_spool.h"
#include "src/stream/metadata.h"
#include "src/util/file.h"
#include "src/util/hash.h"
#include "src/util/json_text.h"
#include "src/util/spool.h"

/* What is built: a mesh, and its controlled fields. */
struct input {
    struct tetmesh mesh;
    struct io_report read;
    struct build_control controls[2 * MAX_CONTROLS + 1]; // a magnitude brings its vector; and how far points move
    uint32_t count;
};

static const char *const phase_names[BUILD_PHASES] = {"contract", "measure", "encode"};

static bool on_progress(void *opaque, enum build_phase phase, double done)
{
    struct build_request *request = opaque;
    if (phase != request->phase) {
        double now = clock_seconds();
        request->seconds[request->phase] += now - request->phase_started;
        request->phase_started = now;
        request->phase = phase;
        scratch_memory_settle(phase == BUILD_MEASURE); // cells, and pages, take most of the limit themselves
    }
    progress_update(&request->progress, phase_names[phase], done);
    return true;
}

/* ---- fields */

static enum tetlod_status choose_fields(struct build_request *request, struct tetmesh *mesh,
                                        const struct tetmesh *later, struct build_control *controls, uint32_t *count,
                                        struct tetlod_error *error)
{
    bool among = request->carry && request->carry[0];
    bool usual = !request->field_count && request->usual_count;
    const struct field_choice choice = {.texts = usual ? request->usual : request->fields,
                                        .units = usual ? NULL : request->units,
                                        .count = usual ? request->usual_count : request->field_count,
                                        .without = request->without,
                                        .without_count = request->without_count,
                                        .among = among ? request->carry : NULL,
                                        .first_only = request->carry && !among,
                                        .later = later};
    request->regions_are_found = !request->region;
    TETLOD_TRY(field_choice_make(&choice, mesh, controls, count, error));
    TETLOD_TRY(build_regions_choose(mesh, request->region, &request->build.regions, error));
    if (request->carry)
        TETLOD_TRY(carry_only(mesh, request->carry, request->build.regions, controls, *count, error));
    return TETLOD_OK;
}

/* ---- the build */

/* Adds the units of fields, where the file says them, to an object of units by name. */
static void add_units(json_t *units, const struct point_field *fields, uint32_t count)
{
    for (uint32_t f = 0; f < count; f++)
        if (fields[f].unit[0])
            json_object_set_new(units, fields[f].name, json_string(fields[f].unit));
}

/* The same of its local bound. */
static void add_bound_unit(json_t *units, const struct point_field *field)
{
    char *name = field->unit[0] ? local_bound_name(field->name) : NULL;
    if (name)
        json_object_set_new(units, name, json_string(field->unit));
    free(name);
}

/* The names of the fields that are ids. */
static void add_ids(json_t *object, const struct tetmesh *mesh)
{
    json_t *ids = json_array();
    for (uint32_t f = 0; f < mesh->field_count; f++)
        if (mesh->fields[f].is_ids)
            json_array_append_new(ids, json_string(mesh->fields[f].name));
    if (object && json_array_size(ids))
        json_object_set(object, "ids", ids);
    json_decref(ids);
}

/* Units, and provenance: what made the stream out of what. Machine and moment are left out, so that bytes repeat. */
static char *make_metadata(const struct build_request *request, const struct tetmesh *mesh,
                           const struct build_control *controls, uint32_t count)
{
    const struct build_options *build = &request->build;
    json_t *fields = json_array(), *object = NULL;
    for (uint32_t i = 0; i < count && fields; i++)
        json_array_append_new(fields, json_string(mesh->fields[controls[i].field].name));
    object =
        json_pack("{s:s, s:s, s:{s:o, s:s, s:s, s:s, s:i, s:f, s:i, s:f, s:f, s:f}}", "program",
                  "tetlod " TETLOD_VERSION_STRING, "input", cli_base_name(request->input), "options", "field", fields,
                  "metric", build_metric_name(build->metric), "certify", build_certify_name(build->certify), "contract",
                  request->contract, "candidates", 0, // once an option: streams keep their bytes
                  "max_error", build->max_error, "min_tets", (int)build->min_tets, "boundary_angle",
                  build->boundary_angle, "domain_error", build->domain_error, "growth", build->growth);
    if (object && build->series && build->series->own_ranges)
        json_object_set_new(json_object_get(object, "options"), SERIES_RANGE, json_string("step"));
    if (object && request->carry)
        json_object_set_new(json_object_get(object, "options"), "carry", json_string(request->carry));
    if (object && build->keep_features > 0)
        json_object_set_new(json_object_get(object, "options"), "keep_features", json_real(build->keep_features));
    if (object && build->regions)
        json_object_set_new(json_object_get(object, "options"), "region", json_string(build->regions));
    if (object && request->reading.options.nan_fill) {
        json_t *fill = request->reading.fill.kind == NAN_FILL_VALUE ? json_real(request->reading.fill.value)
                                                                    : json_string("neighbours");
        json_object_set_new(json_object_get(object, "options"), "nan_fill", fill);
        json_object_set_new(object, "nan_filled", json_integer((json_int_t)request->nan_filled));
    }
    add_ids(object, mesh);
    json_t *units = json_object();
    add_units(units, mesh->cell_fields, mesh->cell_field_count);
    add_units(units, mesh->fields, mesh->field_count);
    for (uint32_t i = 0; i < count && build->local_bound; i++)
        add_bound_unit(units, &mesh->fields[controls[i].field]);
    if (object && json_object_size(units))
        json_object_set(object, "units", units);
    json_decref(units);
    char *text = object ? json_dumps(object, JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(object);
    if (!text || json_text_is_object(text, strlen(text)))
        return text;
    free(text); // Jansson goes on where it found no room for a piece
    return NULL;
}

static uint64_t hash_fields(uint64_t hash, const struct point_field *fields, uint32_t count, uint32_t rows)
{
    for (uint32_t f = 0; f < count; f++) {
        hash = hash_text(hash, fields[f].name);
        hash = hash_bytes(hash, fields[f].values, (size_t)rows * fields[f].components * sizeof *fields[f].values);
    }
    return hash;
}

/* All bytes of a source, behind others. */
static enum tetlod_status hash_source(uint64_t *io_hash, const struct tetlod_source *source)
{
    unsigned char bytes[1 << 16];
    for (uint64_t at = 0; at < source->size; at += sizeof bytes) {
        size_t size = source->size - at < sizeof bytes ? (size_t)(source->size - at) : sizeof bytes;
        TETLOD_TRY(source->read(source->opaque, at, bytes, size));
        *io_hash = hash_bytes(*io_hash, bytes, size);
    }
    return TETLOD_OK;
}

static enum tetlod_status hash_steps(uint64_t *io_hash, const struct build_series *series, struct tetlod_error *error)
{
    *io_hash = hash_bytes(*io_hash, series->times, series->step_count * sizeof *series->times);
    enum tetlod_status status = hash_source(io_hash, &series->values);
    if (status == TETLOD_OK)
        status = hash_source(io_hash, &series->cell_values);
    return status == TETLOD_OK ? status : tetlodi_fail(error, status, "the values of steps cannot be read again");
}

/* Of several programs, what tells that all have the same mesh, with the same steps, and options. */
static enum tetlod_status check_same(const struct build_options *options, const struct tetmesh *mesh,
                                     struct tetlod_error *error)
{
    const struct work_share *share = options->share;
    if (!share || !share->same)
        return TETLOD_OK;
    uint64_t hash = hash_text(mesh->tet_count, options->metadata);
    hash = hash_bytes(hash, mesh->positions, 3 * (size_t)mesh->vertex_count * sizeof *mesh->positions);
    hash = hash_bytes(hash, mesh->corners, 4 * (size_t)mesh->tet_count * sizeof *mesh->corners);
    hash = hash_fields(hash, mesh->fields, mesh->field_count, mesh->vertex_count);
    hash = hash_fields(hash, mesh->cell_fields, mesh->cell_field_count, mesh->tet_count);
    if (options->series)
        TETLOD_TRY(hash_steps(&hash, options->series, error));
    return share->same(share->opaque, hash, error);
}

static enum tetlod_status write_stream(struct build_request *request, const struct input *in,
                                       const struct tetlodi_sink *sink,
                                       struct build_report *report, struct tetlod_error *error)
{
    struct build_options *options = &request->build;
    char *metadata = make_metadata(request, &in->mesh, in->controls, in->count);
    if (!metadata)
        return tetlodi_fail_nomem(error, "the metadata", 1024);
    options->controls = in->controls;
    options->control_count = in->count;
    options->metadata = metadata;
    options->finds_cost = !request->quiet && !options->share; // all programs contract with the same bounds
    options->progress = on_progress;
    options->progress_opaque = request;
    request->phase = BUILD_CONTRACT;
    request->phase_started = clock_seconds();
    enum tetlod_status status = check_same(options, &in->mesh, error);
    if (status == TETLOD_OK)
        status = build_stream(&in->mesh, options, sink, report, error);
    request->seconds[request->phase] += clock_seconds() - request->phase_started;
    progress_end(&request->progress);
    free(metadata);
    return status;
}

/* What the output has of a stream that was made in memory: all of it, its first levels, or it in a VTKHDF file. */
static enum tetlod_status write_made(const struct build_request *request, const struct buffer *whole,
                                     const struct tetlodi_sink *file, struct tetlod_error *error)
{
    struct buffer mail = {0};
    struct tetlod_file *stream = NULL;
    const struct tetlodi_sink sink = buffer_sink(&mail);
    const bool shows = show_is_output(request->output);
    enum tetlod_status status = TETLOD_OK;
    if (request->for_mail)
        status = mail_write(whole, request->mail_error, shows ? &sink : file, error);
    if (status == TETLOD_OK && shows) {
        const struct buffer *made = request->for_mail ? &mail : whole;
        status = tetlod_open_memory(&stream, made->bytes, made->size, NULL, error);
        if (status == TETLOD_OK)
            status = show_write(stream, request->show_error, file, error);
        tetlod_close(stream);
    }
    buffer_fini(&mail);
    return status;
}

static enum tetlod_status build_file(struct build_request *request, const struct input *in, struct build_report *report,
                                     double *write_seconds, struct tetlod_error *error)
{
    struct file_output *output;
    struct buffer whole = {0};
    TETLOD_TRY(file_output_open(&output, request->output, error));
    const bool in_memory = request->for_mail || show_is_output(request->output);
    const struct tetlodi_sink file = file_output_sink(output), sink = in_memory ? buffer_sink(&whole) : file;
    enum tetlod_status status = write_stream(request, in, &sink, report, error);
    double encoded = clock_seconds();
    if (status == TETLOD_OK && in_memory)
        status = write_made(request, &whole, &file, error);
    status = file_output_finish(output, status, error);
    *write_seconds = clock_seconds() - encoded;
    buffer_fini(&whole);
    return status;
}

/* Is it a series? Then --time has not chosen one step of it. */
static bool is_series(const struct build_request *request, const struct io_report *read)
{
    return !request->reading.options.time && (request->series.path_count > 1 || read->steps > 1);
}

/* The mesh, or a series' first step. */
static enum tetlod_status read_first(struct build_request *request, struct tetmesh *mesh, struct io_report *read,
                                     struct tetlod_error *error)
{
    const struct series_input *series = &request->series;
    if (request->reading.options.time)
        return io_read(mesh, request->input, &request->reading.options, read, error);
    if (series->from)
        return series_input_read(series, series_input_number(series, 0), &request->reading, mesh, read, error);
    TETLOD_TRY(series_input_read(series, 0, &request->reading, mesh, read, error));
    uint64_t steps = series->path_count > 1 ? series->path_count : read->steps;
    if (steps < 2 || series->begin == 0)
        return TETLOD_OK;
    tetmesh_fini(mesh);
    if (series->begin >= steps)
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "%s: has %" PRIu64 " steps in time, 0 to %" PRIu64 ": --times begins behind them",
                            request->input, steps, steps - 1);
    return series_input_read(series, series->begin, &request->reading, mesh, read, error);
}

/* The last step, if it must say whether fields of whole numbers are ids: a flow often begins with whole numbers. */
static enum tetlod_status read_later(const struct build_request *request, const struct tetmesh *first,
                                     const struct io_report *read, struct tetmesh *later, struct tetlod_error *error)
{
    const struct series_input *series = &request->series;
    uint64_t steps = series->path_count > 1 ? series->path_count : read->steps;
    struct io_report report;
    bool asks = false;
    for (uint32_t f = 0; f < first->field_count; f++) {
        const struct point_field *field = &first->fields[f];
        asks |= !ids_by_kind(field) && ids_by_values(field, (size_t)field->components * first->vertex_count);
    }
    if (!asks || !is_series(request, read))
        return TETLOD_OK;
    return series_input_read(series, series->end < steps ? series->end : steps - 1, &request->reading, later, &report,
                             error);
}

/* Why a series cannot be built with these options, or NULL. */
static const char *against_series(const struct build_request *request)
{
    const struct build_options *build = &request->build;
    if (build->metric != METRIC_ENVELOPE || build->certify != CERTIFY_FAST || build->contract != CONTRACT_EDGES)
        return "--metric, --certify exact or --contract";
    if (quantise_wanted(&build->quantise) || request->for_mail)
        return "rounding (--position-bits, --field-bits, --for mail and the like)";
    if (request->moves_boundary && build->domain_error > 0)
        return "--domain-error: it keeps its boundary";
    if (build->keep_features > 0)
        return "--keep-features";
    return build->certify_all ? "--certify-all" : build->local_bound ? "--local-bound" : NULL;
}

static enum tetlod_status load_series(struct build_request *request, struct input *in, struct tetlod_error *error)
{
    const char *wrong = against_series(request);
    struct series_input *series = &request->series;
    if (wrong && series->path_count > 1)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "%.60s is a second step in time, and a series cannot be built with %s (--json, --all and "
                            "--quiet take no value)",
                            cli_base_name(series->paths[1]), wrong);
    if (wrong)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "it has several steps in time, and a series cannot be built with %s; --time N builds one "
                            "step",
                            wrong);
    TETLOD_TRY(series_input_count(series, series->path_count > 1 ? series->path_count : in->read.steps, error));
    TETLOD_TRY(series_input_load(series, &request->reading, &in->mesh, in->controls, &in->count, &request->progress,
                                 error));
    request->build.series = &series->series;
    request->build.domain_error = 0; // a step's error is then one at the same position (PROOF.md, 5)
    return TETLOD_OK;
}

/* The mesh, or what there is of the series from the current step on, with what is controlled. */
static enum tetlod_status prepare(struct build_request *request, struct input *in, struct tetlod_error *error)
{
    struct tetlod_error inner = {0};
    struct tetmesh later = {0};
    *in = (struct input){0};
    TETLOD_TRY(read_first(request, &in->mesh, &in->read, error));
    request->nan_filled += in->read.nan_filled;
    enum tetlod_status status = read_later(request, &in->mesh, &in->read, &later, &inner);
    if (status == TETLOD_OK)
        status =
            choose_fields(request, &in->mesh, later.vertex_count ? &later : NULL, in->controls, &in->count, &inner);
    tetmesh_fini(&later);
    if (status == TETLOD_OK && is_series(request, &in->read))
        status = load_series(request, in, &inner);
    else if (status == TETLOD_OK && !request->build.keep_order)
        status = space_order_settle(&in->mesh, &inner);
    return status == TETLOD_OK ? status : tetlodi_fail(error, status, "%s: %s", request->input, inner.message);
}

static void release(struct build_request *request, struct input *in)
{
    series_input_fini(&request->series);
    tetmesh_fini(&in->mesh);
}

/* ---- steps over several meshes */

/* The same fields in the same order in every group: their ranges are common. */
static enum tetlod_status check_controls(const struct input *in, const char *const *names, uint32_t count,
                                         struct tetlod_error *error)
{
    for (uint32_t c = 0; c < count; c++)
        if (c >= in->count || strcmp(in->mesh.fields[in->controls[c].field].name, names[c]) != 0)
            return tetlodi_fail(error, TETLOD_ERR_FIELD,
                                "'%.60s' is not among its controlled fields, as in the first step; --field names the "
                                "ones to be controlled", names[c]);
    return TETLOD_OK;
}

static enum tetlod_status build_topology(struct build_request *request, struct topology_spool *spool, uint32_t group,
                                         const char *const *names,
                                         uint32_t count, struct tetlod_error *error)
{
    const struct series_topology *topology = &request->topologies.groups[group];
    const struct tetlodi_sink sink = topology_spool_sink(spool);
    struct input in;
    struct build_report report;
    struct tetlod_error inner = {0};
    request->series.from = topology->from;
    enum tetlod_status status = prepare(request, &in, error);
    if (status == TETLOD_OK) {
        status = check_controls(&in, names, count, &inner);
        if (status == TETLOD_OK)
            status = write_stream(request, &in, &sink, &report, &inner);
        if (status == TETLOD_OK)
            status = topology_spool_note(spool, group, topology->count, request->topologies.times + topology->from,
                                         &inner);
        if (status != TETLOD_OK)
            series_input_blame(&request->series, series_input_number(&request->series, 0), status, &inner, error);
    }
    release(request, &in);
    return status;
}

static enum tetlod_status build_rest(struct build_request *request, struct topology_spool *spool,
                                     const char *const *names, uint32_t count,
                                     struct tetlod_error *error)
{
    const struct series_topologies *topologies = &request->topologies;
    request->series.series.ranges = (const double(*)[2])topologies->ranges;
    request->usual = names;
    request->usual_count = count;
    TETLOD_TRY(topology_spool_init(spool, topologies->count, error));
    TETLOD_TRY(topology_spool_note(spool, 0, topologies->groups[0].count, topologies->times, error));
    for (uint32_t g = 1; g < topologies->count; g++)
        TETLOD_TRY(build_topology(request, spool, g, names, count, error));
    TETLOD_TRY(topology_spool_sections(spool, error));
    request->build.sections = spool->sections;
    request->build.section_count = sizeof spool->sections / sizeof *spool->sections;
    return TETLOD_OK;
}

/* Steps behind those of `in` are over other meshes: they become streams, which go into the one of the first steps. */
static enum tetlod_status build_topologies(struct build_request *request, struct input *in,
                                           struct topology_spool *spool, struct tetlod_error *error)
{
    uint32_t count = in->count - request->series.series.points_move;
    char *copies[2 * MAX_CONTROLS + 1];
    bool room = true;
    for (uint32_t c = 0; c < count; c++)
        room &= (copies[c] = strdup(in->mesh.fields[in->controls[c].field].name)) != NULL;
    release(request, in);
    const char *const *names = (const char *const *)copies;
    enum tetlod_status status = room ? TETLOD_OK : tetlodi_fail_nomem(error, "the fields' names",
                                                                      count * sizeof *copies);
    if (status == TETLOD_OK)
        status = series_topologies_find(&request->topologies, &request->series, &request->reading, names, count,
                                        &request->progress, error);
    if (status == TETLOD_OK)
        status = build_rest(request, spool, names, count, error);
    request->series.from = 0;
    request->nan_filled = 0;
    request->usual_count = 0;
    for (uint32_t c = 0; c < count; c++)
        free(copies[c]);
    return status == TETLOD_OK ? prepare(request, in, error) : status;
}

/* ---- memory */

/* Takes what --memory says. Else several programs take their share each: until the mesh is known, what they need in
 * any case. */
static enum tetlod_status take_memory(struct build_request *request, struct tetlod_error *error)
{
    const struct build_options *options = &request->build;
    const struct work_share *share = options->share;
    request->by_share = share && share->call && !share->keeps_parts && share->members > 1 && !options->memory;
    return scratch_memory_take(request->scratch,
                               request->by_share ? build_share_bytes(NULL, options, share->members) : options->memory,
                               error);
}

/* All programs hear what they may take, and whether large arrays are in files. */
static enum tetlod_status tell_memory(const struct build_options *options, struct tetlod_error *error)
{
    const struct work_share *share = options->share;
    enum work_call call = CALL_MEMORY;
    uint64_t bytes = options->memory;
    uint8_t spools = options->spools;
    if (!work_has_lasting_helpers(share) || !bytes)
        return TETLOD_OK;
    TETLOD_TRY(share->call(share, &call, &share, error));
    share->pass(share->opaque, &bytes, sizeof bytes);
    share->pass(share->opaque, &spools, sizeof spools);
    return TETLOD_OK;
}

/* Large arrays are in files from now on, or all in memory. */
static void choose_memory(bool spools)
{
    if (spools)
        scratch_memory_settle(false);
    else
        scratch_memory_stay();
}

/* Chooses between memory and files. */
static enum tetlod_status fit_memory(struct build_request *request, const struct input *in, struct tetlod_error *error)
{
    struct tetlod_error inner = {0};
    struct build_options *options = &request->build;
    options->controls = in->controls;
    options->control_count = in->count;
    if (request->by_share && !options->series) {
        options->memory = build_share_bytes(&in->mesh, options, options->share->members);
        scratch_memory_allow(options->memory);
    }
    enum tetlod_status status = options->series ? TETLOD_OK : build_fit_memory(&in->mesh, options, &inner);
    if (status == TETLOD_OK && !options->series)
        TETLOD_TRY(tell_memory(options, error));
    choose_memory(options->spools);
    if (options->spools && spool_in_memory() && !request->quiet)
        fprintf(stderr, "tetlod build: %s is in memory itself, and what is written there takes some; --scratch names a "
                        "folder on a disk\n", spool_folder());
    return status == TETLOD_OK ? status : tetlodi_fail(error, status, "%s: %s", request->input, inner.message);
}

/* ---- several programs */

/* They make one stream by cells. */
static enum tetlod_status fit_share(struct build_request *request, struct tetlod_error *error)
{
    struct build_options *options = &request->build;
    const char *wrong = options->series ? NULL : build_against_pages(options);
    if (!options->share)
        return TETLOD_OK;
    if (wrong)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%s: cannot be built by several programs: %s", request->input,
                            wrong);
    if (!options->series && !options->paged)
        options->paged = BUILD_CELL_TETS;
    return TETLOD_OK;
}

/* The exit status of a failure. Of ranks the one that has failed by itself is heard. */
static int fail(const struct build_request *request, const struct tetlod_error *error)
{
    bool is_others = error->status == TETLOD_ERR_CANCELLED && request->reading.options.sharing;
    return is_others ? EXIT_FAILED : cli_fail(error);
}

/* What a helper is called for besides the build: it reads pieces, and hears what it may take. */
static enum tetlod_status help_otherwise(void *opaque, enum work_call call, struct tetlod_error *error)
{
    const struct build_request *request = opaque;
    const struct work_share *share = request->build.share;
    uint64_t bytes = 0;
    uint8_t spools = 1;
    if (call == CALL_PIECES)
        return io_read_help(share, &request->reading.options, error);
    share->pass(share->opaque, &bytes, sizeof bytes);
    share->pass(share->opaque, &spools, sizeof spools);
    scratch_memory_allow(bytes);
    choose_memory(spools);
    return TETLOD_OK;
}

/* Of one that has no mesh. */
static int help_others(struct build_request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    const struct helper_hooks hooks = {help_otherwise, scratch_memory_settle, request};
    enum tetlod_status status = take_memory(request, &error);
    if (status == TETLOD_OK)
        status = build_helper(request->build.share, request->build.threads, &hooks, &error);
    if (status == TETLOD_ERR_NOMEM && scratch_memory_failure(&inner) != TETLOD_OK)
        error = inner;
    return status == TETLOD_OK ? EXIT_DONE : fail(request, &error);
}

/* One of them writes. */
static enum tetlod_status build_output(struct build_request *request, const struct input *in,
                                       struct build_report *report, double *write_seconds, struct tetlod_error *error)
{
    return build_writes(&request->build) ? build_file(request, in, report, write_seconds, error)
                                        : write_stream(request, in, NULL, report, error);
}

static int build(struct build_request *request)
{
    struct tetlod_error error = {0}, inner = {0};
    struct build_report report = {0};
    struct input in;
    struct topology_spool spool = {0};
    double started = clock_seconds(), read_seconds, write_seconds = 0;
    enum tetlod_status status = take_memory(request, &error);
    in = (struct input){0};
    if (status == TETLOD_OK && build_writes(&request->build))
        status = file_output_check(request->output, &error);
    if (status == TETLOD_OK)
        status = prepare(request, &in, &error);
    bool goes_on = status == TETLOD_OK && request->build.series && series_input_goes_on(&request->series);
    bool idles = goes_on && !build_writes(&request->build); // steps over several meshes are not shared
    if (goes_on && !idles) {
        request->build.share = NULL;
        status = build_topologies(request, &in, &spool, &error);
    }
    if (status == TETLOD_OK && !idles)
        status = fit_share(request, &error);
    if (status == TETLOD_OK && !idles)
        status = fit_memory(request, &in, &error);
    read_seconds = clock_seconds() - started;
    if (status == TETLOD_OK && !idles) {
        status = build_output(request, &in, &report, &write_seconds, &inner);
        bool named = status == TETLOD_ERR_IO; // the output's path is in it already
        if (status != TETLOD_OK)
            tetlodi_fail(&error, status, "%s%s%s", named ? "" : request->input, named ? "" : ": ", inner.message);
    }
    if (status == TETLOD_ERR_NOMEM && scratch_memory_failure(&inner) != TETLOD_OK)
        error = inner;
    int result = status == TETLOD_OK ? EXIT_DONE : fail(request, &error);
    if (status == TETLOD_OK && !request->quiet)
        build_notes(request, &in.read, &in.mesh, in.controls, in.count, &report);
    if (status == TETLOD_OK && request->json)
        result = build_print_json(request, &report, read_seconds, write_seconds);
    else if (status == TETLOD_OK && !request->quiet)
        result = build_print_levels(request);
    topology_spool_fini(&spool);
    series_topologies_fini(&request->topologies);
    release(request, &in);
    return result;
}

int build_together(int argc, char **argv, const struct work_share *share)
{
    struct build_request request;
    const struct io_sharing sharing = {.share = share};
    int result = build_request_parse(&request, argc, argv);
    if (result != EXIT_DONE)
        return result;
    request.build.share = share;
    if (share && share->call && !share->keeps_parts)
        request.reading.options.sharing = &sharing;
    if (work_helps(share))
        return help_others(&request);
    request.quiet |= !build_writes(&request.build);
    request.json &= build_writes(&request.build);
    progress_init(&request.progress, request.draws_progress && !request.quiet, request.quiet);
    return build(&request);
}

static int run(int argc, char **argv)
{
    return build_together(argc, argv, NULL);
}

const struct command command_build = {"build", "read a mesh, contract it, write the stream of its levels", build_help,
                                      run};
