/* SPDX-License-Identifier: BSD-3-Clause */
/* libtetlod-build: a mesh of arrays in memory, checked and copied, goes through the pipeline that the program uses. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/library/library.h"
#include "src/mesh/space_order.h"
#include "src/pipeline/build_helper.h"
#include "src/pipeline/build_warnings.h"
#include "src/pipeline/field_choice.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

static const char *const phase_names[BUILD_PHASES] = {[BUILD_CONTRACT] = "contract", [BUILD_MEASURE] = "measure",
                                                      [BUILD_ENCODE] = "encode"};

void tetlod_build_defaults(struct tetlod_build_options *options)
{
    const struct build_options usual = build_options_default();
    *options = (struct tetlod_build_options){.struct_size = sizeof *options,
                                             .max_error = usual.max_error,
                                             .min_tets = usual.min_tets,
                                             .domain_error = usual.domain_error,
                                             .boundary_angle = usual.boundary_angle,
                                             .growth = usual.growth,
                                             .compression = usual.compression};
}

/* ---- arrays */

/* Value i of an array as the double that it is. A 64 bit integer beyond 2^53 is none: false. */
static bool value_at(const void *values, enum tetlod_cell_type type, size_t i, double *out)
{
    switch (type) {
    case TETLOD_CELL_FLOAT32:
        *out = ((const float *)values)[i];
        return true;
    case TETLOD_CELL_FLOAT64:
        *out = ((const double *)values)[i];
        return true;
    case TETLOD_CELL_INT8:
        *out = ((const int8_t *)values)[i];
        return true;
    case TETLOD_CELL_INT16:
        *out = ((const int16_t *)values)[i];
        return true;
    case TETLOD_CELL_INT32:
        *out = ((const int32_t *)values)[i];
        return true;
    case TETLOD_CELL_INT64:
        *out = (double)((const int64_t *)values)[i];
        return *out >= -0x1p53 && *out <= 0x1p53;
    }
    return false;
}

static enum tetlod_status check_array(const struct tetlod_build_array *array, const char *what,
                                      enum tetlod_cell_type last,
                                      struct tetlod_error *error)
{
    if (!array->name || !*array->name || !array->values || array->components < 1)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "values of %s need a name, at least one component, and an array", what);
    if ((unsigned)array->type > (unsigned)last)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "'%.60s': values of %s cannot have type %d", array->name, what,
                            (int)array->type);
    return TETLOD_OK;
}

/* Fills the field that was added for an array. */
static enum tetlod_status copy_values(struct point_field *field, const struct tetlod_build_array *array, size_t rows,
                                      struct tetlod_error *error)
{
    field->is_integer = array->type > TETLOD_CELL_FLOAT64;
    for (size_t i = 0; i < rows * array->components; i++)
        if (!value_at(array->values, array->type, i, &field->values[i]))
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "'%.60s': the integer at %zu is beyond 2^53", array->name, i);
    return TETLOD_OK;
}

static enum tetlod_type type_of(const struct tetlod_build_array *array)
{
    return array->type == TETLOD_CELL_FLOAT32 ? TETLOD_FLOAT32 : TETLOD_FLOAT64;
}

static enum tetlod_status copy_fields(struct tetmesh *mesh, const struct tetlod_build_mesh *given,
                                      struct tetlod_error *error)
{
    for (uint32_t f = 0; f < given->field_count; f++) {
        const struct tetlod_build_array *array = &given->fields[f];
        TETLOD_TRY(check_array(array, "points", TETLOD_CELL_INT64, error));
        if (tetmesh_find_field(mesh, array->name) != TETLOD_NONE)
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "two fields are named '%.60s'", array->name);
        TETLOD_TRY(tetmesh_add_field(mesh, array->name, array->components, type_of(array), error));
        TETLOD_TRY(copy_values(&mesh->fields[f], array, given->vertices, error));
    }
    for (uint32_t f = 0; f < given->cell_field_count; f++) {
        const struct tetlod_build_array *array = &given->cell_fields[f];
        TETLOD_TRY(check_array(array, "tetrahedra", TETLOD_CELL_INT64, error));
        if (tetmesh_find_cell_field(mesh, array->name) != TETLOD_NONE)
            return tetlodi_fail(error, TETLOD_ERR_FIELD, "two fields of tetrahedra are named '%.60s'", array->name);
        TETLOD_TRY(tetmesh_add_cell_field(mesh, array->name, array->components, type_of(array), given->tets, error));
        TETLOD_TRY(copy_values(&mesh->cell_fields[f], array, given->tets, error));
    }
    return TETLOD_OK;
}

static enum tetlod_status copy_mesh(struct tetmesh *mesh, const struct tetlod_build_mesh *given,
                                    struct tetlod_error *error)
{
    size_t points = 3 * (size_t)given->vertices, corners = 4 * (size_t)given->tets;
    if (!given->positions || !given->corners ||
        (given->position_type != TETLOD_FLOAT32 && given->position_type != TETLOD_FLOAT64))
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                            "a mesh needs positions of type float32 or float64, and corners");
    mesh->positions = array_new(points, sizeof *mesh->positions);
    mesh->corners = array_new(corners, sizeof *mesh->corners);
    if (!mesh->positions || !mesh->corners)
        return tetlodi_fail_nomem(error, "the mesh", 8 * (uint64_t)points + 4 * (uint64_t)corners);
    mesh->vertex_count = given->vertices;
    mesh->tet_count = given->tets;
    mesh->position_type = given->position_type;
    for (size_t i = 0; i < points; i++)
        mesh->positions[i] = given->position_type == TETLOD_FLOAT32 ? ((const float *)given->positions)[i]
                                                                    : ((const double *)given->positions)[i];
    if (corners)
        memcpy(mesh->corners, given->corners, corners * sizeof *mesh->corners);
    TETLOD_TRY(copy_fields(mesh, given, error));
    TETLOD_TRY(tetmesh_validate_tets(mesh, error));
    TETLOD_TRY(tetmesh_drop_unused(mesh, error));
    return tetmesh_validate(mesh, error);
}

enum tetlod_status library_copy_mesh(struct tetmesh *out, const struct tetlod_build_mesh *mesh,
                                     struct tetlod_error *error)
{
    struct tetlod_build_mesh given = {0};
    memcpy(&given, mesh, mesh->struct_size < sizeof given ? mesh->struct_size : sizeof given);
    return copy_mesh(out, &given, error);
}

/* ---- options */

struct progress_of_caller {
    int (*call)(void *opaque, const char *phase, double done);
    void *opaque;
};

static bool pass_progress(void *opaque, enum build_phase phase, double done)
{
    const struct progress_of_caller *caller = opaque;
    return caller->call(caller->opaque, phase_names[phase], done) != 0;
}

static enum tetlod_status check_options(const struct build_options *options, struct tetlod_error *error)
{
    struct build_range bad;
    if (!build_options_out_of_range(options, &bad))
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "%s is %g .. %g, not %g; tetlod_build_defaults sets what is usual",
                        bad.member, bad.least,
                        bad.most, bad.value);
}

static struct build_options options_of(const struct tetlod_build_options *options)
{
    struct build_options build = build_options_default();
    build.max_error = options->max_error;
    build.min_tets = options->min_tets ? options->min_tets : 1;
    build.domain_error = options->domain_error;
    build.boundary_angle = options->boundary_angle;
    build.growth = options->growth;
    build.compression = options->compression;
    build.certify_all = options->certify_all;
    build.local_bound = options->local_bound;
    build.summary = options->summary;
    build.keep_features = options->keep_features;
    build.keep_order = options->keep_order;
    build.quantise = (struct quantise_options){options->position_bits, options->field_bits, options->position_error,
                                               options->field_error};
    build.threads = options->threads ? options->threads : parallel_cores();
    build.memory = options->memory;
    build.metadata =
        options->metadata ? options->metadata : "{\"program\":\"libtetlod-build " TETLOD_VERSION_STRING "\"}";
    if (options->certify_exact) {
        build.certify = CERTIFY_EXACT;
        build.metric = METRIC_FIELD_QUADRIC;
    }
    return build;
}

enum tetlod_status library_options(const struct tetlod_build_options *options, struct tetlod_build_options *out,
                                   struct build_options *out_build, struct tetlod_error *error)
{
    tetlod_build_defaults(out);
    if (options)
        memcpy(out, options, options->struct_size < sizeof *out ? options->struct_size : sizeof *out);
    *out_build = options_of(out);
    return check_options(out_build, error);
}

/* ---- building */

enum tetlod_status library_choose(struct tetmesh *mesh, const struct tetlod_build_options *given, bool has_steps,
                                  struct build_options *build, struct build_control **out_controls,
                                  struct tetlod_error *error)
{
    uint32_t count;
    size_t room = 2 * MAX_CONTROLS; // a magnitude brings its vector
    struct build_control *controls = *out_controls = array_new(room, sizeof *controls);
    const struct field_choice choice = {.texts = given->controls,
                                        .count = given->control_count,
                                        .without = given->without,
                                        .without_count = given->without_count,
                                        .has_steps = has_steps};
    if (!controls)
        return tetlodi_fail_nomem(error, "the controlled fields", room * sizeof *controls);
    TETLOD_TRY(field_choice_make(&choice, mesh, controls, &count, error));
    TETLOD_TRY(build_regions_choose(mesh, given->region, &build->regions, error));
    build->controls = controls;
    build->control_count = count;
    return TETLOD_OK;
}

enum tetlod_status library_build(const struct tetmesh *mesh, const struct tetlod_build_options *given,
                                 struct build_options build, const struct tetlodi_sink *sink,
                                 struct tetlod_error *error)
{
    struct build_report report;
    struct progress_of_caller caller = {given->progress, given->progress_opaque};
    if (caller.call) {
        build.progress = pass_progress;
        build.progress_opaque = &caller;
    }
    enum tetlod_status status = build_stream(mesh, &build, sink, &report, error);
    if (status == TETLOD_OK && given->warn)
        build_warnings(&report, given->warn, given->warn_opaque);
    return status;
}

enum tetlod_status library_build_copy(struct tetmesh *copy, const struct tetlod_build_options *options,
                                      const struct work_share *share, const struct tetlodi_sink *sink,
                                      struct tetlod_error *error)
{
    struct tetlod_build_options given;
    struct build_options build;
    struct build_control *controls = NULL;
    enum tetlod_status status = library_options(options, &given, &build, error);
    if (status == TETLOD_OK && work_helps(share))
        return build_helper(share, build.threads, &(struct helper_hooks){0}, error);
    build.share = share;
    build.paged = share ? BUILD_CELL_TETS : build.paged; // programs that build together do so by cells
    if (status == TETLOD_OK)
        status = library_choose(copy, &given, false, &build, &controls, error);
    if (status == TETLOD_OK && !build.keep_order)
        status = space_order_settle(copy, error);
    if (status == TETLOD_OK)
        status = library_build(copy, &given, build, sink, error);
    free(controls);
    return status;
}

enum tetlod_status tetlod_build(const struct tetlod_build_mesh *mesh, const struct tetlod_build_options *options,
                                enum tetlod_status (*write)(void *opaque, const void *bytes, size_t size), void *opaque,
                                struct tetlod_error *error)
{
    const struct tetlodi_sink sink = {write, opaque};
    struct tetmesh copy = {0};
    enum tetlod_status status = library_copy_mesh(&copy, mesh, error);
    if (status == TETLOD_OK)
        status = library_build_copy(&copy, options, NULL, &sink, error);
    tetmesh_fini(&copy);
    return status;
}
