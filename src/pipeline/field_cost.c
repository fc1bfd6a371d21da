/* SPDX-License-Identifier: BSD-3-Clause */
/*
 *   1. The coarsest mark within the error, as a mesh: coarsening_advance.
 *   2. Which fields bind: at every vertex the field whose bound and whose difference from the mean of the vertex's
 * neighbours are largest, as a fraction of its range, gets a vote.
 *   3. For the MAX_TRIALS fields with most votes: a piece of that mesh with the other fields, and their bounds, is
 * contracted to the error.
 */
#include "src/pipeline/field_cost.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/log/coarsening.h"
#include "src/mesh/tet_geom.h"
#include "src/simplify/further.h"
#include "src/util/array.h"

/* A field is named where the level would have so many times fewer tetrahedra without it. */
static const double MIN_SAVING = 1.2;

/* Where trials begin, as a part of the error: lower rungs order the contractions. */
static const double FIRST_RUNG = 0.1;

enum { MAX_TRIALS = 2 };

struct cost_search {
    const struct tetmesh *mesh;
    const struct contraction_log *log;
    const uint32_t *controlled;
    uint32_t count;
    const struct simplify_options *options;
    struct simplify_options trial; /* those of a contraction of the level */
    struct coarsening coarsening;
    struct tetmesh level;          /* without cell fields */
    uint32_t *node;                /* [vertex of the level] in the log */
    double *regions;               /* [tet of the level], or NULL */
    struct tetlod_error *error;
};

static enum tetlod_status no_memory(const struct cost_search *search)
{
    return tetlodi_fail_nomem(search->error, "what fields cost", 64 * (uint64_t)search->mesh->vertex_count);
}

/* ---- the level */

static uint32_t find_mark(const struct contraction_log *log, double error)
{
    uint32_t mark = 0;
    for (uint32_t m = 0; m < log->mark_count; m++) {
        double worst = 0;
        for (uint32_t d = 0; d < log->component_count; d++)
            worst = larger(worst, log->certified[(size_t)m * log->component_count + d]);
        mark = worst <= error * (1 + 1e-9) ? m : mark;
    }
    return mark;
}

/* Numbers the living slots: number [slot], and their nodes. */
static uint32_t number_slots(struct cost_search *search, uint32_t contractions, uint32_t *number)
{
    const struct coarsening *coarse = &search->coarsening;
    uint32_t count = 0, *node = search->node;
    for (uint32_t s = 0; s < coarse->slot_count; s++)
        node[s] = s;
    for (uint32_t c = 0; c < contractions; c++)
        node[coarse->slot_of[c]] = search->log->vertex_count + c;
    for (uint32_t s = 0; s < coarse->slot_count; s++) {
        bool lives = !(coarse->slots[s] & SLOT_MERGED);
        number[s] = lives ? count : TETLOD_NONE;
        node[count] = node[s];
        count += lives;
    }
    return count;
}

static enum tetlod_status fill_level(struct cost_search *search, const uint32_t *number)
{
    const struct coarsening *coarse = &search->coarsening;
    struct tetmesh *level = &search->level;
    for (uint32_t t = 0, to = 0; t < search->mesh->tet_count; t++) {
        uint32_t now = coarsening_number(coarse, t);
        if (now == TETLOD_NONE)
            continue;
        for (size_t c = 0; c < 4; c++)
            level->corners[4 * (size_t)to + c] = number[coarse->corners[4 * (size_t)now + c]];
        if (search->regions)
            search->regions[to] = search->options->regions[t];
        to++;
    }
    for (uint32_t i = 0; i < search->count; i++) {
        const struct point_field *of = &search->mesh->fields[search->controlled[i]];
        const double *values = coarse->fields[search->controlled[i]].values;
        TETLOD_TRY(tetmesh_add_field(level, of->name, of->components, of->type, search->error));
        level->fields[i].grid = of->grid;
        for (uint32_t s = 0; s < coarse->slot_count; s++)
            if (number[s] != TETLOD_NONE)
                memcpy(level->fields[i].values + (size_t)number[s] * of->components,
                       values + (size_t)s * of->components, of->components * sizeof *values);
    }
    for (uint32_t s = 0; s < coarse->slot_count; s++)
        if (number[s] != TETLOD_NONE)
            memcpy(level->positions + 3 * (size_t)number[s], coarse->positions + 3 * (size_t)s, 3 * sizeof(double));
    return TETLOD_OK;
}

static enum tetlod_status make_level(struct cost_search *search, const struct log_mark *mark)
{
    uint32_t *number = array_new(search->mesh->vertex_count, sizeof *number);
    struct tetmesh *level = &search->level;
    search->node = array_new(search->mesh->vertex_count + (size_t)1, sizeof *search->node);
    enum tetlod_status status = number && search->node
                                    ? coarsening_init(&search->coarsening, search->mesh, search->log, search->error)
                                    : no_memory(search);
    if (status == TETLOD_OK)
        status = coarsening_advance(&search->coarsening, search->log, mark->contractions, search->options->threads,
                                    search->error);
    if (status == TETLOD_OK) {
        *level = (struct tetmesh){.position_type = search->mesh->position_type,
                                  .vertex_count = number_slots(search, mark->contractions, number),
                                  .tet_count = search->coarsening.tets};
        memcpy(level->position_grid, search->mesh->position_grid, sizeof level->position_grid);
        level->positions = array_new(level->vertex_count, 3 * sizeof(double));
        level->corners = array_new(level->tet_count, 4 * sizeof(uint32_t));
        search->regions = search->options->regions ? array_new(level->tet_count, sizeof *search->regions) : NULL;
        bool room = level->positions && level->corners && (search->regions || !search->options->regions);
        status = room ? fill_level(search, number) : no_memory(search);
    }
    coarsening_fini(&search->coarsening);
    free(number);
    return status;
}

/* ---- votes */

/* A bound of a component at a vertex of the level: 0 where nothing was contracted. */
static double bound_at(const struct cost_search *search, uint32_t v, uint32_t component)
{
    uint32_t node = search->node[v];
    return node < search->log->vertex_count
               ? 0
               : search->log->components[component].bounds[node - search->log->vertex_count];
}

/* Adds to sums[v] what the neighbours of v say, and counts them. */
static void sum_neighbours(const struct tetmesh *level, const double *values, uint32_t stride, double *sums,
                           uint32_t *counts)
{
    for (size_t t = 0; t < level->tet_count; t++) {
        const uint32_t *corners = level->corners + 4 * t;
        double sum = 0;
        for (int c = 0; c < 4; c++)
            sum += values[(size_t)corners[c] * stride];
        for (int c = 0; c < 4; c++) {
            sums[corners[c]] += sum - values[(size_t)corners[c] * stride];
            counts[corners[c]] += 3;
        }
    }
}

/* votes [field of the level]. */
static enum tetlod_status vote(const struct cost_search *search, uint32_t *votes)
{
    const struct tetmesh *level = &search->level;
    size_t n = level->vertex_count;
    double *sums = array_new(n, sizeof *sums), *most = array_zero(n, sizeof *most);
    uint32_t *counts = array_new(n, sizeof *counts), *whose = array_zero(n, sizeof *whose);
    enum tetlod_status status = sums && most && counts && whose ? TETLOD_OK : no_memory(search);
    for (uint32_t f = 0, d = 0; f < level->field_count && status == TETLOD_OK; f++)
        for (uint32_t c = 0; c < level->fields[f].components; c++, d++) {
            const double *values = level->fields[f].values + c;
            uint32_t stride = level->fields[f].components;
            memset(sums, 0, n * sizeof *sums);
            memset(counts, 0, n * sizeof *counts);
            sum_neighbours(level, values, stride, sums, counts);
            for (uint32_t v = 0; v < n; v++) {
                double off = fabs(values[(size_t)v * stride] - sums[v] / counts[v]) + bound_at(search, v, d);
                whose[v] = off * search->log->components[d].scale > most[v] ? f : whose[v];
                most[v] = larger(most[v], off * search->log->components[d].scale);
            }
        }
    for (uint32_t v = 0; v < n && status == TETLOD_OK; v++)
        votes[whose[v]] += most[v] > 0;
    free(sums);
    free(most);
    free(counts);
    free(whose);
    return status;
}

/* ---- a trial */

/* The bounds of all components but those of a field, vertex by vertex. */
static void collect_bounds(const struct cost_search *search, uint32_t without, double *out)
{
    for (uint32_t v = 0; v < search->level.vertex_count; v++)
        for (uint32_t i = 0, d = 0; i < search->count; i++)
            for (uint32_t c = 0; c < search->level.fields[i].components; c++, d++)
                if (i != without)
                    *out++ = bound_at(search, v, d);
}

/* Tetrahedra within the error without a field. */
static enum tetlod_status try_without(const struct cost_search *search, uint32_t without, uint32_t *out_tets)
{
    uint32_t *rest = array_new(search->count, sizeof *rest), count = 0;
    double(*ranges)[2] = array_new(search->count, sizeof *ranges);
    double *bounds = array_new((size_t)search->level.vertex_count * search->log->component_count, sizeof *bounds);
    enum tetlod_status status = rest && ranges && bounds ? TETLOD_OK : no_memory(search);
    for (uint32_t i = 0; i < search->count && status == TETLOD_OK; i++)
        if (i != without) {
            const struct point_field *field = &search->mesh->fields[search->controlled[i]];
            point_field_range(field, search->mesh->vertex_count, ranges[count]);
            rest[count++] = i;
        }
    if (status == TETLOD_OK) {
        const struct further further = {&search->level, bounds, (const double(*)[2])ranges,
                                        FIRST_RUNG * FIELD_COST_ERROR};
        collect_bounds(search, without, bounds);
        status = simplify_further(out_tets, &further, rest, count, &search->trial, search->error);
    }
    free(rest);
    free(ranges);
    free(bounds);
    return status;
}

static enum tetlod_status try_fields(const struct cost_search *search, struct field_cost *out)
{
    uint32_t *votes = array_zero(search->count, sizeof *votes);
    enum tetlod_status status = votes ? vote(search, votes) : no_memory(search);
    for (int trial = 0; trial < MAX_TRIALS && status == TETLOD_OK; trial++) {
        uint32_t most = 0, tets = 0;
        for (uint32_t i = 1; i < search->count; i++)
            most = votes[i] > votes[most] ? i : most;
        if (!votes[most])
            break;
        status = try_without(search, most, &tets);
        if (status == TETLOD_OK && tets && MIN_SAVING * tets <= search->level.tet_count &&
            (out->field == TETLOD_NONE || tets < out->tets_without))
            *out = (struct field_cost){search->controlled[most], search->level.tet_count, tets};
        votes[most] = 0;
    }
    free(votes);
    return status;
}

enum tetlod_status field_cost_find(struct field_cost *out, const struct tetmesh *mesh,
                                   const struct contraction_log *log, const uint32_t *controlled, uint32_t count,
                                   const struct simplify_options *options, struct tetlod_error *error)
{
    struct cost_search search = {.mesh = mesh,
                                 .log = log,
                                 .controlled = controlled,
                                 .count = count,
                                 .options = options,
                                 .trial = *options,
                                 .error = error};
    const struct log_mark *mark = &log->marks[find_mark(log, FIELD_COST_ERROR)];
    *out = (struct field_cost){.field = TETLOD_NONE};
    search.trial.max_error = FIELD_COST_ERROR;
    search.trial.min_tets = 1;
    search.trial.local_bound = false;
    search.trial.progress = NULL;
    search.trial.boundary_limit = larger(options->boundary_limit - mark->moved, options->boundary_least);
    enum tetlod_status status = make_level(&search, mark);
    search.trial.regions = search.regions;
    if (status == TETLOD_OK)
        status = try_fields(&search, out);
    tetmesh_fini(&search.level);
    free(search.node);
    free(search.regions);
    return status;
}
