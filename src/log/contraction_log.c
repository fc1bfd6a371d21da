/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/log/contraction_log.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

static bool allocate(struct contraction_log *log, const struct tetmesh *mesh)
{
    size_t n = mesh->vertex_count;
    log->children = array_new(n, 4 * sizeof(uint32_t));
    log->positions = array_new(n, 3 * sizeof(double));
    log->fields = array_zero(mesh->field_count, sizeof *log->fields);
    if (!log->children || !log->positions || !log->fields)
        return false;
    log->field_count = mesh->field_count;
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        size_t components = mesh->fields[f].components;
        log->fields[f] = (struct log_field){mesh->fields[f].components, array_new(n, components * sizeof(double))};
        if (!log->fields[f].values)
            return false;
    }
    return true;
}

enum tetlod_status log_init(struct contraction_log *log, const struct tetmesh *mesh, struct tetlod_error *error)
{
    *log = (struct contraction_log){.vertex_count = mesh->vertex_count};
    if (allocate(log, mesh))
        return TETLOD_OK;
    log_fini(log);
    return tetlodi_fail_nomem(error, "the contraction log", 48 * (uint64_t)mesh->vertex_count);
}

void log_fini(struct contraction_log *log)
{
    for (uint32_t f = 0; f < log->field_count; f++)
        free(log->fields[f].values);
    free(log->fields);
    for (uint32_t c = 0; c < log->component_count; c++)
        free(log->components[c].bounds);
    free(log->children);
    free(log->positions);
    free(log->components);
    free(log->marks);
    free(log->certified);
    free(log->predicted);
    *log = (struct contraction_log){0};
}

enum tetlod_status log_control(struct contraction_log *log, const struct log_component *components, uint32_t count,
                               struct tetlod_error *error)
{
    log->components = array_new(count, sizeof *components);
    if (!log->components)
        return tetlodi_fail_nomem(error, "the controlled components", count * sizeof *components);
    memcpy(log->components, components, count * sizeof *components);
    log->component_count = count;
    return TETLOD_OK;
}

enum tetlod_status log_keep_bounds(struct contraction_log *log, struct tetlod_error *error)
{
    for (uint32_t c = 0; c < log->component_count; c++) {
        log->components[c].bounds = array_new(log->vertex_count, sizeof(double));
        if (!log->components[c].bounds)
            return tetlodi_fail_nomem(error, "the local bounds", log->vertex_count * sizeof(double));
    }
    return TETLOD_OK;
}

uint32_t log_extend(struct contraction_log *log, uint32_t count)
{
    uint32_t first = log->count;
    assert(count <= log->vertex_count - first);
    log->count += count;
    return first;
}

static bool reserve(double **array, size_t *capacity, size_t count)
{
    return ARRAY_RESERVE(*array, *capacity, count);
}

enum tetlod_status log_mark(struct contraction_log *log, uint32_t vertices, uint32_t tets, double moved,
                            const double *certified, const double *predicted, struct tetlod_error *error)
{
    size_t count = log->mark_count, width = log->component_count;
    if (count && log->marks[count - 1].contractions == log->count)
        return TETLOD_OK;
    bool room = ARRAY_RESERVE(log->marks, log->mark_capacity, count + 1);
    room = room && reserve(&log->certified, &log->certified_capacity, (count + 1) * width) &&
           reserve(&log->predicted, &log->predicted_capacity, (count + 1) * width);
    if (!room)
        return tetlodi_fail_nomem(error, "the levels", (count + 1) * (sizeof *log->marks + 16 * width));
    log->marks[count] = (struct log_mark){log->count, vertices, tets, moved};
    memcpy(log->certified + count * width, certified, width * sizeof *certified);
    memcpy(log->predicted + count * width, predicted, width * sizeof *predicted);
    log->mark_count++;
    return TETLOD_OK;
}

void log_move_mark(struct contraction_log *log, uint32_t from, uint32_t to)
{
    size_t width = log->component_count;
    log->marks[to] = log->marks[from];
    memmove(log->certified + to * width, log->certified + from * width, width * sizeof *log->certified);
    memmove(log->predicted + to * width, log->predicted + from * width, width * sizeof *log->predicted);
}

void log_finish(struct contraction_log *log)
{
    log->children = array_shrink(log->children, log->count, 4 * sizeof *log->children);
    log->positions = array_shrink(log->positions, log->count, 3 * sizeof *log->positions);
    for (uint32_t f = 0; f < log->field_count; f++)
        log->fields[f].values = array_shrink(log->fields[f].values, log->count,
                                             log->fields[f].components * sizeof(double));
    for (uint32_t c = 0; c < log->component_count && log->components[c].bounds; c++)
        log->components[c].bounds = array_shrink(log->components[c].bounds, log->count, sizeof(double));
}
