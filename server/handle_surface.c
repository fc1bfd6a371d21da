/* SPDX-License-Identifier: BSD-3-Clause */
/* Surfaces of a level: its boundary, isosurfaces, plane sections. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/cut/cut.h"
#include "server/level.h"
#include "server/surface_write.h"
#include "src/util/array.h"

enum shape { BOUNDARY, ISOSURFACE, SLICE };

/* What is asked for, as numbers: two spellings of one surface are one answer. */
struct surface_choice {
    enum shape shape;
    const struct surface_format *format;
    uint32_t level;
    uint32_t field, component; /* ISOSURFACE */
    double value;
    double origin[3], normal[3]; /* SLICE */
};

struct surface_context {
    struct site *site;
    struct cache_entry *forest_entry; /* held */
    const struct forest *forest;
    struct surface_choice choice;
    enum coding coding;
};

static void surface_context_free(void *opaque)
{
    struct surface_context *context = opaque;
    cache_release(context->site->forests, context->forest_entry);
    free(context);
}

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

static enum tetlod_status make_surface(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct surface_context *context = opaque;
    struct tetmesh mesh;
    struct cut surface = {0};
    struct buffer buffer = {0};
    double started = monotonic_seconds();
    enum tetlod_status status = forest_mesh(context->forest, context->choice.level, &mesh, error);
    if (status != TETLOD_OK)
        return status;
    status = cut(&mesh, &context->choice, &surface, error);
    if (status == TETLOD_OK)
        status = context->choice.format->write(&mesh, &surface, &buffer);
    cut_fini(&surface);
    tetmesh_fini(&mesh);
    if (status == TETLOD_OK)
        status = buffer_encode(&buffer, context->coding, error);
    if (status == TETLOD_OK)
        status = body_take(&buffer, started, out, error);
    buffer_fini(&buffer);
    metrics_count(context->site->metrics, METRIC_LEVELS_MADE);
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
static bool take_field(struct exchange *exchange, const struct tetlod_info *info, struct surface_choice *choice)
{
    char name[256] = "";
    enum query_result result = query_value(exchange->query, "field", name, sizeof name);
    uint64_t component = 0;
    choice->field = result == QUERY_FOUND ? tetlod_field_index(info, name) : TETLOD_NONE;
    char *colon = strrchr(name, ':');
    bool scalar = choice->field != TETLOD_NONE && info->fields[choice->field].components == 1;
    if (!scalar && colon && text_count(colon + 1, false, &component)) {
        *colon = 0;
        choice->field = tetlod_field_index(info, name);
        scalar = choice->field != TETLOD_NONE && component < info->fields[choice->field].components;
    }
    choice->component = (uint32_t)component;
    if (scalar)
        return true;
    response_problem_choices(exchange->response, 400, exchange->request->target, "fields", field_names(info),
                             result == QUERY_ABSENT ? "say of which field: field=NAME, or field=NAME:0 for a vector's component"
                                                    : "there is no scalar field '%.128s'; a vector's component is NAME:0",
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
    response_problem(exchange->response, 400, exchange->request->target, "%s is needed, such as %s=%s", name, name, example);
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

static bool take_shape(struct exchange *exchange, const struct tetlod_info *info, struct surface_choice *choice)
{
    static const char *const none[] = {NULL}, *const iso[] = {"field", "value", NULL}, *const plane[] = {"origin", "normal", NULL};
    switch (choice->shape) {
    case ISOSURFACE:
        return check_parameters(exchange, iso) && take_field(exchange, info, choice) &&
               take_numbers(exchange, "value", 1, "0.5", &choice->value);
    case SLICE:
        return check_parameters(exchange, plane) && take_plane(exchange, choice);
    default:
        return check_parameters(exchange, none);
    }
}

/* ---- the answer ---- */

static void print_key(const struct surface_choice *choice, const char *cid, char *out, size_t capacity)
{
    int used = snprintf(out, capacity, "%s-%" PRIu32 "-%s%d", cid, choice->level, choice->format->name, (int)choice->shape);
    if (choice->shape == ISOSURFACE)
        snprintf(out + used, capacity - (size_t)used, "-%" PRIu32 ":%" PRIu32 "=%.17g", choice->field, choice->component,
                 choice->value);
    if (choice->shape == SLICE)
        snprintf(out + used, capacity - (size_t)used, "-%.17g,%.17g,%.17g-%.17g,%.17g,%.17g", choice->origin[0],
                 choice->origin[1], choice->origin[2], choice->normal[0], choice->normal[1], choice->normal[2]);
}

static uint64_t surface_bytes(const struct tetlod_info *info, uint32_t level)
{
    uint64_t components = 4;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return info->levels[level].vertices * components * 24 + info->levels[level].tets * (uint64_t)48 + 65536;
}

/* Makes a surface; its value is NULL if it is not there yet, or the response says why it will not be. */
static enum outcome make(struct exchange *exchange, struct dataset *dataset, const struct surface_choice *choice,
                         enum coding coding, const char *key, const struct cache_value **out)
{
    const struct forest *forest;
    *out = NULL;
    enum outcome outcome = obtain_forest(exchange, dataset, &forest);
    if (!forest)
        return outcome;
    struct surface_context *context = array_new(1, sizeof *context);
    if (!context) {
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    struct cache_entry *forest_entry = request_pin(exchange->request, exchange->site->forests);
    cache_hold(exchange->site->forests, forest_entry);
    *context = (struct surface_context){exchange->site, forest_entry, forest, *choice, coding};
    const struct recipe recipe = {make_surface, surface_context_free, context,
                                  surface_bytes(dataset_info(dataset), choice->level)};
    return obtain(exchange, exchange->site->cache, key, &recipe, out);
}

static enum outcome answer_surface(struct exchange *exchange, struct dataset *dataset, const struct surface_choice *choice)
{
    const struct tetlod_info *info = dataset_info(dataset);
    enum coding coding = coding_choose(request_header(exchange->request, "Accept-Encoding"));
    enum outcome outcome = ANSWERED;
    char key[320], coded_key[330], etag[80];
    uint64_t hash = 0xcbf29ce484222325u;
    print_key(choice, info->cid, key, sizeof key);
    for (const char *c = key; *c; c++)
        hash = (hash ^ (unsigned char)*c) * 0x100000001b3u;
    snprintf(etag, sizeof etag, "%s-%016" PRIx64, info->cid, hash);
    snprintf(coded_key, sizeof coded_key, "%s/%s", key, coding_name(coding));
    const struct cache_value *value = obtain_cached(exchange, exchange->site->cache, coded_key);
    if (!value)
        outcome = make(exchange, dataset, choice, coding, coded_key, &value);
    if (value) {
        respond_body(exchange, value, choice->format->media_type, coding, etag);
        if (exchange->response->status == 200) {
            cache_forever(exchange->response);
            level_headers(exchange->response, dataset, choice->level);
        }
    }
    return outcome;
}

static enum outcome handle_shape(struct exchange *exchange, enum shape shape)
{
    struct dataset *dataset = captured_dataset(exchange);
    struct surface_choice choice = {.shape = shape};
    enum outcome outcome = ANSWERED;
    if (!dataset)
        return ANSWERED;
    const struct tetlod_info *info = dataset_info(dataset);
    if (parse_level(exchange, info, exchange->captures[2], &choice.level) &&
        take_format(exchange, exchange->captures[3], &choice) && take_shape(exchange, info, &choice))
        outcome = answer_surface(exchange, dataset, &choice);
    dataset_release(dataset);
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
