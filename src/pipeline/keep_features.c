/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/keep_features.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/ask/features.h"
#include "src/log/coarsening.h"
#include "src/util/array.h"

static uint32_t count_components(const struct tetmesh *mesh, const struct build_options *options)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < options->control_count; i++)
        count += mesh->fields[options->controls[i].field].components;
    return count;
}

/* Maxima and minima of one component of a mesh's values, [components * vertex]. To be released, also after a
 * failure. */
static enum tetlod_status find(struct features *out, struct feature_mesh *mesh, const double *values,
                               uint32_t components, uint32_t component, double persistence, struct tetlod_error *error)
{
    *out = (struct features){0};
    double *own = array_new(mesh->vertices, sizeof *own);
    if (!own)
        return tetlodi_fail_nomem(error, "the features", mesh->vertices * sizeof *own);
    for (size_t v = 0; v < mesh->vertices; v++)
        own[v] = values[components * v + component];
    mesh->lower = mesh->middle = mesh->upper = own;
    enum tetlod_status status = TETLOD_OK;
    for (int k = FEATURE_MAXIMUM; k <= FEATURE_MINIMUM && status == TETLOD_OK; k++)
        status = features_find(out, mesh, &(struct feature_query){(enum feature_kind)k, persistence, 0}, error);
    free(own);
    return status;
}

static enum tetlod_status count_original(struct kept_features *kept, const struct tetmesh *mesh, uint32_t field,
                                         uint32_t at, struct tetlod_error *error)
{
    const struct point_field *of = &mesh->fields[field];
    struct feature_mesh whole = {.positions = mesh->positions, .corners = mesh->corners,
                                 .vertices = mesh->vertex_count, .tets = mesh->tet_count};
    struct features features;
    enum tetlod_status status = TETLOD_OK;
    double range[2];
    point_field_range(of, mesh->vertex_count, range);
    for (uint32_t c = 0; c < of->components && status == TETLOD_OK; c++, at++) {
        kept->persistences[at] = kept->options->keep_features * (range[1] - range[0]);
        status = find(&features, &whole, of->values, of->components, c, kept->persistences[at], error);
        memcpy(kept->counts[at], features.proven, sizeof kept->counts[at]);
        for (size_t i = 0; i < features.count; i++)
            kept->fixed[features.list[i].vertex] = kept->fixed[features.list[i].end] = true;
        features_fini(&features);
    }
    return status;
}

enum tetlod_status kept_features_init(struct kept_features *kept, const struct tetmesh *original,
                                      const struct build_options *options, struct tetlod_error *error)
{
    uint32_t components = count_components(original, options), at = 0;
    *kept = (struct kept_features){options, array_zero(original->vertex_count, sizeof *kept->fixed),
                                   array_new(components, sizeof *kept->counts),
                                   array_new(components, sizeof *kept->persistences), components};
    if (!kept->fixed || !kept->counts || !kept->persistences)
        return tetlodi_fail_nomem(error, "the features", original->vertex_count + 16 * (uint64_t)components);
    for (uint32_t i = 0; i < options->control_count; i++) {
        uint32_t field = options->controls[i].field;
        TETLOD_TRY(count_original(kept, original, field, at, error));
        at += original->fields[field].components;
    }
    return TETLOD_OK;
}

void kept_features_fini(struct kept_features *kept)
{
    free(kept->fixed);
    free(kept->counts);
    free(kept->persistences);
    *kept = (struct kept_features){0};
}

/* Has the mesh that the coarsening is at the original's numbers? `corners` has room for its tetrahedra. */
static enum tetlod_status compare(const struct kept_features *kept, const struct coarsening *coarsening,
                                  uint32_t *corners, bool *out, struct tetlod_error *error)
{
    struct feature_mesh level = {.positions = coarsening->positions, .corners = corners,
                                 .vertices = coarsening->slot_count};
    struct features features;
    enum tetlod_status status = TETLOD_OK;
    for (size_t t = 0; t < coarsening->stored; t++)
        if (coarsening->states[t] < COARSE_DIED)
            memcpy(corners + 4 * (size_t)level.tets++, coarsening->corners + 4 * t, 4 * sizeof *corners);
    *out = true;
    for (uint32_t i = 0, at = 0; i < kept->options->control_count; i++) {
        const struct coarse_field *field = &coarsening->fields[kept->options->controls[i].field];
        for (uint32_t c = 0; c < field->components && *out && status == TETLOD_OK; c++, at++) {
            status = find(&features, &level, field->values, field->components, c, kept->persistences[at], error);
            *out = memcmp(kept->counts[at], features.proven, sizeof kept->counts[at]) == 0;
            features_fini(&features);
        }
    }
    return status;
}

static enum tetlod_status filter(const struct kept_features *kept, struct coarsening *coarsening, uint32_t *corners,
                                 struct contraction_log *log, struct tetlod_error *error)
{
    uint32_t left = 0;
    for (uint32_t mark = 0; mark < log->mark_count; mark++) {
        bool same;
        if (mark)
            TETLOD_TRY(coarsening_advance(coarsening, log, log->marks[mark].contractions, kept->options->threads,
                                          error));
        TETLOD_TRY(compare(kept, coarsening, corners, &same, error));
        if (!same && mark == 0)
            return tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                                "the rounding of values changes how many maxima and minima have a persistence above "
                                "%g of the range: keep features of another one", kept->options->keep_features);
        if (same)
            log_move_mark(log, mark, left++);
    }
    log->mark_count = left;
    log->count = log->marks[left - 1].contractions;
    return TETLOD_OK;
}

enum tetlod_status kept_features_filter(const struct kept_features *kept, const struct tetmesh *mesh,
                                        struct contraction_log *log, struct tetlod_error *error)
{
    struct coarsening coarsening = {0};
    uint32_t *corners = array_new(mesh->tet_count, 4 * sizeof *corners);
    if (!corners)
        return tetlodi_fail_nomem(error, "the features", 16 * (uint64_t)mesh->tet_count);
    enum tetlod_status status = coarsening_init(&coarsening, mesh, log, error);
    if (status == TETLOD_OK)
        status = filter(kept, &coarsening, corners, log, error);
    coarsening_fini(&coarsening);
    free(corners);
    return status;
}
