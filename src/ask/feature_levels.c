/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/feature_levels.h"

#include <math.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* What rounding moves of a boundary that keeps its place: of the diagonal (PROOF.md 5). */
static const double KEPT = 1e-12;

/* A level is looked at when it has so many times the tetrahedra of the one before. */
static const double NEXT_LOOK = 1.5;

/* Functions that enclose the original's, at vertices. */
struct enclosure {
    double *lower, *middle, *upper;
};

struct finding {
    struct tetlod_file *file;
    const struct tetlod_info *info;
    const struct feature_request *request;
    uint32_t fields[2], field_count; /* the quantity's, and its local bound */
};

enum tetlod_status feature_quantity(const char *text, bool is_name, struct ask_quantity *out,
                                    struct tetlod_error *error)
{
    struct ask_question question;
    char sentence[300];
    if (is_name && strlen(text) < sizeof out->name) {
        *out = (struct ask_quantity){.component = ASK_SCALAR};
        memcpy(out->name, text, strlen(text) + 1);
        return TETLOD_OK;
    }
    if ((size_t)snprintf(sentence, sizeof sentence, "max(%s)", text) >= sizeof sentence ||
        ask_parse(sentence, &question, NULL) != TETLOD_OK || question.in_box || question.over_region ||
        question.compare != ASK_NO_LIMIT)
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "there is no field '%.100s'; of a vector NAME ask for |NAME| or a component NAME:0", text);
    *out = question.quantity;
    return TETLOD_OK;
}

static enum tetlod_status check_component(const struct ask_quantity *quantity, uint32_t components,
                                          struct tetlod_error *error)
{
    if (quantity->component == ASK_SCALAR && components > 1)
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "%.100s has %u components: ask for its length |%.60s| or a component %.60s:0",
                            quantity->name, components, quantity->name, quantity->name);
    if (quantity->component >= (int)components)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "%.100s has the components 0 to %u, not %d", quantity->name,
                            components - 1, quantity->component);
    return TETLOD_OK;
}

static void enclosure_fini(struct enclosure *enclosure)
{
    free(enclosure->lower);
    free(enclosure->middle);
    free(enclosure->upper);
}

static enum tetlod_status enclosure_init(struct enclosure *out, uint32_t vertices, struct tetlod_error *error)
{
    *out = (struct enclosure){array_new(vertices, sizeof(double)), array_new(vertices, sizeof(double)),
                              array_new(vertices, sizeof(double))};
    if (out->lower && out->middle && out->upper)
        return TETLOD_OK;
    enclosure_fini(out);
    return tetlodi_fail_nomem(error, "the field", 24 * (uint64_t)vertices);
}

static double length(const double *vector, uint32_t components)
{
    double sum = 0;
    for (uint32_t i = 0; i < components; i++)
        sum += vector[i] * vector[i];
    return sqrt(sum);
}

/* A length is convex: in a tetrahedron the interpolated lengths of its corners are above it, and its tangent at the
 * mean vector is below. At a vertex the least of its tetrahedra's tangents counts. */
static void lower_lengths(struct enclosure *out, const struct feature_values *mesh)
{
    enum { MAX_COMPONENTS = 64 };
    for (size_t t = 0; t < mesh->tets; t++) {
        double mean[MAX_COMPONENTS] = {0};
        for (int c = 0; c < 4; c++)
            for (uint32_t i = 0; i < mesh->components; i++)
                mean[i] += mesh->values[(size_t)mesh->components * mesh->corners[4 * t + (size_t)c] + i];
        double size = length(mean, mesh->components);
        for (int c = 0; c < 4; c++) {
            uint32_t vertex = mesh->corners[4 * t + (size_t)c];
            double along = 0;
            for (uint32_t i = 0; i < mesh->components && size > 0; i++)
                along += mesh->values[(size_t)mesh->components * vertex + i] * (mean[i] / size);
            out->lower[vertex] = fmin(out->lower[vertex], along);
        }
    }
}

/* Lengths between linear functions, with room for their rounding. */
static void enclose_lengths(struct enclosure *out, const struct feature_values *mesh)
{
    static const double ROUNDING = 1e-13;
    for (uint32_t v = 0; v < mesh->vertices; v++)
        out->lower[v] = out->middle[v] = length(mesh->values + (size_t)mesh->components * v, mesh->components);
    lower_lengths(out, mesh);
    for (uint32_t v = 0; v < mesh->vertices; v++) {
        out->upper[v] = out->middle[v] * (1 + ROUNDING);
        out->lower[v] -= ROUNDING * out->middle[v];
    }
}

/* `bounds` may be NULL: then `error` holds everywhere. */
static enum tetlod_status enclose(struct enclosure *out, const struct feature_values *mesh, int component,
                                  const double *bounds, double error_bound, struct tetlod_error *error)
{
    double scale = component == ASK_LENGTH ? sqrt((double)mesh->components) * (1 + 1e-12) : 1;
    if (component == ASK_LENGTH)
        enclose_lengths(out, mesh);
    else
        for (uint32_t v = 0; v < mesh->vertices; v++)
            out->lower[v] = out->middle[v] = out->upper[v] =
                mesh->values[(size_t)mesh->components * v + (uint32_t)(component < 0 ? 0 : component)];
    for (uint32_t v = 0; v < mesh->vertices; v++) {
        double bound = scale * (bounds ? bounds[v] : error_bound);
        if (bound > 0) {
            out->lower[v] = nextafter(out->lower[v] - bound, -INFINITY);
            out->upper[v] = nextafter(out->upper[v] + bound, INFINITY);
        }
        if (!isfinite(out->lower[v]) || !isfinite(out->upper[v]) || !(bound >= 0))
            return tetlodi_fail(error, TETLOD_ERR_FIELD,
                                "the value of vertex %u is not finite, so that nothing is certain around it", v);
    }
    return TETLOD_OK;
}

static void set_persistence(const struct feature_request *request, struct feature_answer *out)
{
    double width = out->range[1] - out->range[0];
    out->persistence = request->absolute ? request->persistence : request->persistence * width;
}

/* Is all that there may be proven? */
static bool is_decided(const struct features *features)
{
    for (int k = 0; k < FEATURE_KINDS; k++)
        if (features->asked[k] && (!features->bounded[k] || features->possible[k]))
            return false;
    return true;
}

static enum tetlod_status find(const struct feature_values *mesh, const struct enclosure *enclosure, bool exact,
                               const struct feature_request *request, struct feature_answer *out,
                               struct tetlod_error *error)
{
    const struct feature_mesh of = {.positions = mesh->positions, .corners = mesh->corners,
                                    .vertices = mesh->vertices, .tets = mesh->tets,
                                    .lower = exact ? enclosure->middle : enclosure->lower,
                                    .middle = enclosure->middle,
                                    .upper = exact ? enclosure->middle : enclosure->upper};
    const bool levels = request->has_above || request->has_below;
    const bool asked[FEATURE_KINDS] = {!levels, !levels, request->has_above, request->has_below};
    const double thresholds[FEATURE_KINDS] = {0, 0, request->above, request->below};
    features_fini(&out->features);
    out->tets = mesh->tets;
    for (int k = 0; k < FEATURE_KINDS; k++) {
        const struct feature_query query = {(enum feature_kind)k, out->persistence, thresholds[k]};
        if (asked[k])
            TETLOD_TRY(features_find(&out->features, &of, &query, error));
    }
    return TETLOD_OK;
}

static enum tetlod_status find_enclosed(const struct feature_values *mesh, const struct feature_request *request,
                                        const double *bounds, double error_bound, struct feature_answer *out,
                                        struct tetlod_error *error)
{
    struct enclosure enclosure;
    int component = request->quantity.component;
    TETLOD_TRY(enclosure_init(&enclosure, mesh->vertices, error));
    enum tetlod_status status = enclose(&enclosure, mesh, component, bounds, error_bound, error);
    if (status == TETLOD_OK)
        status = find(mesh, &enclosure, !bounds && error_bound == 0 && component != ASK_LENGTH, request, out, error);
    enclosure_fini(&enclosure);
    return status;
}

enum tetlod_status features_of_mesh(const struct feature_values *mesh, const struct feature_request *request,
                                    struct feature_answer *out, struct tetlod_error *error)
{
    *out = (struct feature_answer){.level = TETLOD_NONE, .range = {INFINITY, -INFINITY}};
    TETLOD_TRY(check_component(&request->quantity, mesh->components, error));
    for (size_t i = 0; i < (size_t)mesh->components * mesh->vertices; i++) {
        out->range[0] = fmin(out->range[0], mesh->values[i]);
        out->range[1] = fmax(out->range[1], mesh->values[i]);
    }
    set_persistence(request, out);
    return find_enclosed(mesh, request, NULL, 0, out, error);
}

/* A bound of the field's error anywhere in a level; infinite if there is none, or its boundary has moved. */
static double bound_of(const struct finding *finding, uint32_t level)
{
    const struct tetlod_info *info = finding->info;
    const struct tetlod_field *field = &info->fields[finding->fields[0]];
    double error = info->levels[level].errors[finding->fields[0] * TETLOD_MEASURES + TETLOD_MAX];
    if (level + 1 == info->level_count && info->lossless)
        return 0;
    if (!(info->levels[level].domain_error <= KEPT) || isnan(error) || info->inverted_tets)
        return INFINITY;
    return error * (field->range[1] > field->range[0] ? field->range[1] - field->range[0] : 1) * (1 + 1e-12);
}

/* The finest level that may be taken and certifies something. */
static enum tetlod_status find_last(const struct finding *finding, uint32_t *out, struct tetlod_error *error)
{
    const struct feature_request *request = finding->request;
    const struct tetlod_info *info = finding->info;
    const char *name = request->quantity.name;
    if (request->last == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_TRUNCATED, "it is cut off before the end of level 0");
    for (*out = request->last; *out != request->first - 1; --*out)
        if (!isinf(bound_of(finding, *out)))
            return TETLOD_OK;
    if (isnan(info->levels[request->last].errors[finding->fields[0] * TETLOD_MEASURES + TETLOD_MAX]))
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "no level bounds the error of %.100s: build it with --field %.100s or --certify-all", name,
                            name);
    if (info->inverted_tets)
        return tetlodi_fail(error, TETLOD_ERR_FIELD,
                            "%llu of its tetrahedra are inverted: only the finest level of a lossless stream proves "
                            "anything", (unsigned long long)info->inverted_tets);
    return tetlodi_fail(error, TETLOD_ERR_FIELD,
                        "the boundary has moved in the levels that are asked for (up to %u), and nothing is proved "
                        "there: take a finer level, or build it with --domain-error 0", request->last);
}

static enum tetlod_status find_fields(struct finding *finding, struct feature_answer *out, struct tetlod_error *error)
{
    const struct tetlod_info *info = finding->info;
    const struct ask_quantity *quantity = &finding->request->quantity;
    uint32_t field = tetlod_field_index(info, quantity->name);
    if (field == TETLOD_NONE)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "there is no field '%.100s'; 'tetlod info' lists the fields",
                            quantity->name);
    finding->fields[finding->field_count++] = field;
    for (uint32_t f = 0; f < info->field_count; f++)
        if (info->fields[f].bounds == field && finding->field_count < 2)
            finding->fields[finding->field_count++] = f;
    memcpy(out->range, info->fields[field].range, sizeof out->range);
    return check_component(quantity, info->fields[field].components, error);
}

static enum tetlod_status find_at(const struct finding *finding, const struct tetlod_cursor *cursor, uint32_t level,
                                  struct feature_answer *out, struct tetlod_error *error)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(cursor, &mesh);
    const struct feature_values values = {mesh.positions, mesh.corners, mesh.vertices, mesh.tets,
                                          finding->info->fields[finding->fields[0]].components,
                                          mesh.fields[finding->fields[0]]};
    out->level = level;
    out->error = bound_of(finding, level);
    bool is_local = finding->field_count > 1 && out->error > 0;
    return find_enclosed(&values, finding->request, is_local ? mesh.fields[finding->fields[1]] : NULL, out->error, out,
                         error);
}

/* Without a local bound a level whose functions are further apart than the persistence cannot exclude anything. */
static bool may_decide(const struct finding *finding, const struct feature_answer *out, uint32_t level)
{
    double bound = bound_of(finding, level), looked_at = out->level == TETLOD_NONE ? 0 : out->tets;
    return !isinf(bound) && (finding->field_count > 1 || 2 * bound <= out->persistence) &&
           finding->info->levels[level].tets >= NEXT_LOOK * looked_at;
}

static enum tetlod_status find_in_levels(const struct finding *finding, struct tetlod_cursor *cursor,
                                         struct feature_answer *out, struct tetlod_error *error)
{
    const struct feature_request *request = finding->request;
    uint32_t last = 0;
    TETLOD_TRY(find_last(finding, &last, error));
    for (uint32_t level = request->first; level <= last; level++) {
        if (level < last && !may_decide(finding, out, level))
            continue;
        if (request->wanted && !request->wanted(request->opaque))
            return tetlodi_fail(error, TETLOD_ERR_CANCELLED, "cancelled");
        TETLOD_TRY(tetlod_cursor_seek(cursor, level, error));
        TETLOD_TRY(find_at(finding, cursor, level, out, error));
        if (is_decided(&out->features))
            break;
    }
    return TETLOD_OK;
}

/* Bytes of a client that reads header, index and the field's frames up to the level. */
static enum tetlod_status count_bytes(const struct finding *finding, struct feature_answer *out,
                                      struct tetlod_error *error)
{
    size_t count = tetlod_spans(finding->file, TETLOD_NONE, out->level, finding->fields, finding->field_count, NULL, 0);
    struct tetlod_span *spans = array_new(count, sizeof *spans);
    if (!spans)
        return tetlodi_fail_nomem(error, "the places of the levels", count * sizeof *spans);
    tetlod_spans(finding->file, TETLOD_NONE, out->level, finding->fields, finding->field_count, spans, count);
    for (size_t s = 0; s < count; s++)
        out->bytes += spans[s].size;
    free(spans);
    return TETLOD_OK;
}

enum tetlod_status features_of_stream(struct tetlod_file *file, const struct feature_request *request,
                                      struct feature_answer *out, struct tetlod_error *error)
{
    struct finding finding = {.file = file, .info = tetlod_info(file), .request = request};
    struct tetlod_cursor *cursor;
    *out = (struct feature_answer){.level = TETLOD_NONE};
    TETLOD_TRY(find_fields(&finding, out, error));
    set_persistence(request, out);
    TETLOD_TRY(tetlod_cursor_new(&cursor, file, finding.fields, finding.field_count, error));
    enum tetlod_status status = find_in_levels(&finding, cursor, out, error);
    tetlod_cursor_free(cursor);
    return status == TETLOD_OK ? count_bytes(&finding, out, error) : status;
}

void feature_answer_fini(struct feature_answer *answer)
{
    features_fini(&answer->features);
}
