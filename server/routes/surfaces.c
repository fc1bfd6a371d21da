/* SPDX-License-Identifier: BSD-3-Clause */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/jobs/made.h"
#include "server/routes/handlers.h"
#include "server/routes/steps.h"
#include "src/cut/cut.h"
#include "src/io/io.h"
#include "src/util/array.h"
#include "src/util/number_text.h"

/* A file format of an answer. */
struct surface_format {
    const char *name, *media_type;
    enum tetlod_status (*write)(const struct tetmesh *mesh, const struct cut *surface, const struct tetlodi_sink *sink,
                                struct tetlod_error *error);
};

static const struct surface_format surface_formats[] = {
    {"vtp", "application/vnd.vtk.vtp", io_write_vtp},
    {"stl", "model/stl", io_write_stl},
    {"glb", "model/gltf-binary", io_write_glb},
    {NULL, NULL, NULL},
};

enum shape { BOUNDARY, ISOSURFACE, SLICE };

/* What is asked for, as numbers: two spellings of one surface are one answer. */
struct surface_choice {
    struct step_choice step; /* first: step_answer */
    enum shape shape;
    const struct surface_format *format;
    uint32_t level;
    uint32_t field, component; /* ISOSURFACE: of the mesh */
    double value;
    double origin[3], normal[3]; /* SLICE */
};

static enum tetlod_status cut(const struct tetmesh *mesh, const struct surface_choice *choice, struct cut *out,
                              struct tetlod_error *error)
{
    if (choice->shape == BOUNDARY)
        return cut_boundary(mesh, out, error);
    double *values = array_new(mesh->vertex_count, sizeof *values);
    if (!values)
        return tetlodi_fail_nomem(error, "a surface", 8 * (uint64_t)mesh->vertex_count);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const double *p = mesh->positions + 3 * (size_t)v, *o = choice->origin, *n = choice->normal;
        if (choice->shape == SLICE)
            values[v] = (p[0] - o[0]) * n[0] + (p[1] - o[1]) * n[1] + (p[2] - o[2]) * n[2];
        else {
            const struct point_field *field = &mesh->fields[choice->field];
            values[v] = field->values[(size_t)v * field->components + choice->component] - choice->value;
        }
    }
    enum tetlod_status status = cut_zero(mesh, values, out, error);
    free(values);
    return status;
}

static enum tetlod_status write_surface(const void *opaque, const struct tetmesh *mesh, struct buffer *out,
                                        struct tetlod_error *error)
{
    const struct surface_choice *choice = opaque;
    struct tetlodi_sink sink = buffer_sink(out);
    struct cut surface = {0};
    enum tetlod_status status = cut(mesh, choice, &surface, error);
    if (status == TETLOD_OK)
        status = choice->format->write(mesh, &surface, &sink, error);
    cut_fini(&surface);
    return status;
}

/* ---- what is asked for ---- */

static bool take_format(struct exchange *exchange, const char *name, struct surface_choice *choice)
{
    json_t *names = json_array();
    for (choice->format = surface_formats; choice->format->name; choice->format++) {
        if (strcmp(choice->format->name, name) == 0)
            break;
        json_array_append_new(names, json_string(choice->format->name));
    }
    if (choice->format->name) {
        json_decref(names);
        return true;
    }
    response_problem_choices(exchange->response, 400, exchange->request->target, "formats", names,
                             "surfaces have no format '%.64s'", name);
    return false;
}

/* A scalar field by its name, or a vector's component as NAME:0. */
static bool find_scalar(const struct tetlod_info *info, char *name, struct surface_choice *choice)
{
    uint64_t component = 0;
    choice->field = tetlod_field_index(info, name);
    char *colon = strrchr(name, ':');
    bool scalar = choice->field != TETLOD_NONE && info->fields[choice->field].components == 1;
    if (!scalar && colon && text_count(colon + 1, false, &component)) {
        *colon = 0;
        choice->field = tetlod_field_index(info, name);
        scalar = choice->field != TETLOD_NONE && component < info->fields[choice->field].components;
    }
    choice->component = (uint32_t)component;
    return scalar;
}

static bool take_field(struct exchange *exchange, const struct dataset *dataset, struct surface_choice *choice)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char name[256] = "", form[256] = "";
    enum query_result result = query_value(exchange->query, "field", name, sizeof name);
    bool scalar = result == QUERY_FOUND && (find_scalar(info, name, choice) ||
                  (query_form_value(exchange->query, "field", form, sizeof form) == QUERY_FOUND &&
                   find_scalar(info, form, choice)));
    if (scalar && choice->step.any)
        choice->field = field_with_steps(dataset, choice->field);
    if (scalar && choice->field != TETLOD_NONE)
        return true;
    response_problem_choices(exchange->response, 400, exchange->request->target, "fields", field_names(info),
                             result == QUERY_ABSENT ? "say of which field: field=NAME, or field=NAME:0 for a vector's "
                                                      "component"
                                                    : "there is no scalar field '%.128s'; a vector's component is "
                                                      "NAME:0",
                             name);
    return false;
}

static bool take_numbers(struct exchange *exchange, const char *name, size_t count, const char *example, double *out)
{
    char text[256];
    if (query_value(exchange->query, name, text, sizeof text) == QUERY_FOUND && text_numbers(text, count, out)) {
        for (size_t i = 0; i < count; i++)
            out[i] += 0.0; // -0 is 0: one key for both
        return true;
    }
    response_problem(exchange->response, 400, exchange->request->target, "%s is needed, such as %s=%s", name, name,
                     example);
    return false;
}

static bool take_plane(struct exchange *exchange, struct surface_choice *choice)
{
    if (!take_numbers(exchange, "origin", 3, "0.5,0,0", choice->origin) ||
        !take_numbers(exchange, "normal", 3, "1,0,0", choice->normal))
        return false;
    double length = hypot(hypot(choice->normal[0], choice->normal[1]), choice->normal[2]);
    if (length > 0 && isfinite(length))
        return true;
    response_problem(exchange->response, 400, exchange->request->target, "normal has no direction");
    return false;
}

static bool take_shape(struct exchange *exchange, const struct dataset *dataset, struct surface_choice *choice)
{
    if (!check_parameters(exchange))
        return false;
    switch (choice->shape) {
    case ISOSURFACE:
        return take_field(exchange, dataset, choice) && take_numbers(exchange, "value", 1, "0.5", &choice->value);
    case SLICE:
        return take_plane(exchange, choice);
    default:
        return true;
    }
}

/* ---- the answer ---- */

static void print_name(const struct surface_choice *choice, char *out, size_t capacity)
{
    char of_step[STEP_NAME];
    step_name(&choice->step, of_step);
    int used = snprintf(out, capacity, "%s%d%s", choice->format->name, (int)choice->shape, of_step);
    if (choice->shape == ISOSURFACE)
        snprintf(out + used, capacity - (size_t)used, "-%" PRIu32 ":%" PRIu32 "=%.17g", choice->field,
                 choice->component,
                 choice->value);
    if (choice->shape == SLICE)
        snprintf(out + used, capacity - (size_t)used, "-%.17g,%.17g,%.17g-%.17g,%.17g,%.17g", choice->origin[0],
                 choice->origin[1], choice->origin[2], choice->normal[0], choice->normal[1], choice->normal[2]);
}

/* What a surface takes that does not meet nearly every tetrahedron; room is kept for as much. */
static uint64_t surface_file_bytes(const struct tetlod_info *info, uint32_t level)
{
    uint64_t components = 4;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return info->levels[level].vertices * components * 8 + info->levels[level].tets * (uint64_t)16 + 4096;
}

static enum outcome answer_surface(struct exchange *exchange, struct dataset *dataset,
                                   const struct surface_choice *choice)
{
    char name[200 + STEP_NAME];
    const struct tetlod_info *info = dataset_info(dataset);
    print_name(choice, name, sizeof name);
    struct level_answer answer = {.level = choice->level,
                                  .name = name,
                                  .media_type = choice->format->media_type,
                                  .file_bytes = surface_file_bytes(info, choice->level),
                                  .write = write_surface,
                                  .choice = choice,
                                  .choice_size = sizeof *choice};
    if (choice->step.any)
        step_answer(&answer, info);
    return answer_from_level(exchange, dataset, &answer);
}

/* By a level, or by a band and a step of it: the path says which. */
static bool take_mesh(struct exchange *exchange, struct dataset *dataset, struct surface_choice *choice)
{
    if (!exchange->of_step)
        return parse_level(exchange, dataset_info(dataset), exchange->captures[2], &choice->level);
    bool good = captured_step(exchange, dataset, &choice->step);
    choice->level = good ? choice->step.level : 0;
    return good;
}

static enum outcome handle_shape(struct exchange *exchange, enum shape shape)
{
    static const char *const names[] = {[BOUNDARY] = "surface", [ISOSURFACE] = "isosurface", [SLICE] = "slice"};
    struct dataset *dataset = exchange->dataset;
    struct surface_choice choice;
    const char *format = exchange->captures[exchange->of_step ? 4 : 3];
    char step[STEP_NAME] = "";
    memset(&choice, 0, sizeof choice);
    choice.shape = shape;
    if (!take_mesh(exchange, dataset, &choice) || !take_format(exchange, format, &choice) ||
        !take_shape(exchange, dataset, &choice))
        return ANSWERED;
    enum outcome outcome = answer_surface(exchange, dataset, &choice);
    if (exchange->of_step)
        snprintf(step, sizeof step, "-step%" PRIu32, step_number(&choice.step));
    name_download(exchange, "%s-%s-%s.%s", step, exchange->captures[2], names[shape], format);
    return outcome;
}

enum outcome handle_surface(struct exchange *exchange)
{
    return handle_shape(exchange, BOUNDARY);
}

enum outcome handle_isosurface(struct exchange *exchange)
{
    return handle_shape(exchange, ISOSURFACE);
}

enum outcome handle_slice(struct exchange *exchange)
{
    return handle_shape(exchange, SLICE);
}
