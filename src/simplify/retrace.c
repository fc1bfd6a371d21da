/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Each record of the log becomes the proposal of one vertex, which merge() does as it does in a round: bounds with
 * their rounding, the boundary's map and its demands, tetrahedra and stars. There is no limit; nothing is evaluated.
 */
#include "src/simplify/retrace.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/simplify/rounds/evaluate.h"
#include "src/simplify/rounds/merge.h"
#include "src/util/array.h"

struct retraced {
    struct working working;
    struct contraction_log made; /* what merge() logs: as the given one, with these fields' values */
    struct run run;
    struct worker worker;
    uint32_t *slot_of; /* [node] */
    double *zeros;     /* [component] */
    double *halves, *errors; /* errors: [2 * component], what merge() says */
    struct tetlod_error *error;
};

uint64_t retrace_bytes(const struct tetmesh *mesh, uint32_t components)
{
    uint64_t node = 2 * sizeof(uint32_t), rows = 4 * 8 * (uint64_t)components;
    return evaluate_bytes(mesh, 0) + mesh->vertex_count * (node + rows + 8 * (uint64_t)components);
}

void retrace_bounds(const struct retraced *state, uint32_t node, uint32_t component, double out[2])
{
    const struct component *of = &state->working.components[component];
    const double *row = working_row(&state->working, state->slot_of[node]) + ROW_FIELDS + 2 * component;
    double middle = state->working.fields[of->field].middles[of->component];
    out[0] = nextafter(row[1] + middle, -INFINITY); // the sum is rounded
    out[1] = nextafter(row[0] + middle, INFINITY);
    if (middle == 0) {
        out[0] = row[1];
        out[1] = row[0];
    }
}

static enum tetlod_status no_memory(const struct retraced *state)
{
    return tetlodi_fail_nomem(state->error, "the steps in time", 0);
}

static enum tetlod_status allocate(struct retraced *state, uint32_t nodes)
{
    size_t n = state->working.slot_count, k = state->working.component_count;
    state->run.proposals = proposals_new(n);
    state->slot_of = array_new(nodes, sizeof *state->slot_of);
    state->zeros = array_zero(k, sizeof(double));
    state->halves = array_zero(k, sizeof(double));
    state->errors = array_zero(2 * k, sizeof(double));
    if (!state->run.proposals || !state->slot_of || !state->zeros || !state->halves || !state->errors ||
        !worker_init(&state->worker, &state->working))
        return no_memory(state);
    for (uint32_t slot = 0; slot < n; slot++)
        state->slot_of[state->working.node[slot]] = slot;
    state->run.certified = state->zeros; // values are not chosen here: nothing may be cheapened
    state->run.limit = INFINITY;
    return TETLOD_OK;
}

static void release(struct retraced *state)
{
    void *const owned[] = {state->run.proposals, state->slot_of, state->zeros, state->halves, state->errors};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    worker_fini(&state->worker);
    border_fini(&state->run.border);
    pool_free(state->run.pool);
    working_fini(&state->working);
    log_fini(&state->made);
}

/* One record again. */
static enum tetlod_status follow(struct retraced *state, const struct contraction_log *log, uint32_t record)
{
    struct working *working = &state->working;
    const uint32_t *children = log->children + 4 * (size_t)record;
    const double *p = log->positions + 3 * (size_t)record;
    uint32_t kept = state->slot_of[children[0]], dead = state->slot_of[children[1]];
    bool at_end = distance_squared(working_row(working, kept), p) == 0;
    struct merged merged;
    working_prune(working, kept);
    working_prune(working, dead);
    size_t stars = (size_t)working->stars[kept].count + working->stars[dead].count;
    TETLOD_TRY(working_reserve(working, stars + stars / 4 + 4, state->error));
    state->run.proposals[dead].target = 2 * kept + !at_end;
    merge(&state->run, &state->worker, dead, log_extend(&state->made, 1), NULL, &merged, state->errors,
          state->errors + working->component_count);
    if (state->worker.failed)
        return no_memory(state);
    if (!merged.done || distance_squared(working_row(working, kept), p) != 0)
        return tetlodi_fail(state->error, TETLOD_ERR_MISMATCH, "contraction %u cannot be done again", record);
    state->worker.open_count = state->worker.unfreezing_count = 0;
    working->node[kept] = working->slot_count + record;
    state->slot_of[working->slot_count + record] = kept;
    working->vertices_alive--;
    working->tets_alive -= merged.removed;
    const double *row = working_row(working, kept) + ROW_FIELDS;
    for (uint32_t c = 0; c < working->component_count; c++)
        state->halves[c] = larger(state->halves[c], (row[2 * c] - row[2 * c + 1]) / 2);
    return TETLOD_OK;
}

static enum tetlod_status follow_all(struct retraced *state, const struct contraction_log *log,
                                     enum tetlod_status (*visit)(void *opaque,
                                                                 const struct retrace_mark *mark), void *opaque)
{
    uint32_t done = 0;
    for (uint32_t mark = 0; mark < log->mark_count; mark++) {
        while (done < log->marks[mark].contractions)
            TETLOD_TRY(follow(state, log, done++));
        const struct retrace_mark at = {mark, state->halves, state};
        TETLOD_TRY(visit(opaque, &at));
    }
    return TETLOD_OK;
}

enum tetlod_status retrace(const struct tetmesh *mesh, const struct contraction_log *log,
                           const struct simplify_options *options,
                           enum tetlod_status (*visit)(void *opaque, const struct retrace_mark *mark), void *opaque,
                           struct tetlod_error *error)
{
    struct retraced state = {.error = error};
    uint32_t *fields = array_new(mesh->field_count, sizeof *fields);
    enum tetlod_status status = TETLOD_OK;
    if (!fields)
        return no_memory(&state);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        fields[f] = f;
    state.run.working = &state.working;
    state.run.kernels = kernels_choose();
    TETLOD_TRY_DONE(log_init(&state.made, mesh, error));
    state.run.pool = pool_new(options->threads ? options->threads : 1);
    if (!state.run.pool)
        TETLOD_TRY_DONE(no_memory(&state));
    TETLOD_TRY_DONE(working_init(&state.working, mesh, NULL, fields, mesh->field_count, NULL, &state.made, error));
    TETLOD_TRY_DONE(border_find(&state.working, state.run.pool, error));
    TETLOD_TRY_DONE(border_init(&state.run.border, &state.working, mesh, options->boundary_angle,
                                options->boundary_limit,
                                options->boundary_least, pool_size(state.run.pool), error));
    TETLOD_TRY_DONE(allocate(&state, log->vertex_count + log->count));
    status = follow_all(&state, log, visit, opaque);
done:
    release(&state);
    free(fields);
    return status;
}
