/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/difference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/diff/boundary_shell.h"
#include "src/diff/overlap.h"
#include "src/measure/same.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/bvh.h"
#include "src/mesh/sheets.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

enum { CHUNK = 64 };

/* A tetrahedron is covered if no more than this of it is left. */
static const double COVERED = 1e-9;

/* What rounding makes of sums and of their division: of the sums. */
static const double ROUNDING = 1e-9;

/* A tetrahedron of the second mesh that holds a place inside one of the first, which is on no face but by accident. */
static uint32_t find_first(const struct measuring *measuring, uint32_t tet)
{
    static const double there[4] = {0.31, 0.27, 0.23, 0.19};
    const struct tetmesh *a = measuring->sides[0].mesh;
    double place[3] = {0, 0, 0}, weights[4];
    uint32_t first, last;
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 3; i++)
            place[i] += there[c] * mesh_corner(a, tet, c)[i];
    const double box[6] = {place[0], place[1], place[2], place[0], place[1], place[2]};
    struct bvh_walk walk = bvh_walk_begin(&measuring->tree);
    while (bvh_next_leaf(&walk, box, &first, &last))
        for (uint32_t i = first; i < last; i++) {
            uint32_t other = measuring->tree.order[i];
            weigh_place(&measuring->maps[other], place, weights);
            if (measuring->usable[1][other] && weights[0] > 0 && weights[1] > 0 && weights[2] > 0 && weights[3] > 0)
                return other;
        }
    return TETLOD_NONE;
}

static bool add_to_front(struct overlap_worker *worker, uint32_t tet)
{
    if (!array_reserve((void **)&worker->front, &worker->front_capacity, worker->front_count + 1, sizeof tet))
        return false;
    worker->front[worker->front_count++] = tet;
    return true;
}

/* To those beside a tetrahedron of the second mesh, across the faces that the one of the first reaches behind. */
static void go_on(struct overlap *cell, uint32_t tet)
{
    const struct measuring *measuring = cell->measuring;
    for (int k = 0; k < 4; k++) {
        uint32_t across = measuring->neighbours[4 * (size_t)tet + (size_t)k];
        double least = smaller(smaller(cell->in[0][0][k], cell->in[0][1][k]),
                               smaller(cell->in[0][2][k], cell->in[0][3][k]));
        if (!(least < -THIN))
            continue;
        if (across == TETLOD_NONE || !measuring->usable[1][across / 4])
            cell->ends = true;
        else if (cell->worker->seen[across / 4] != cell->tets[0] + 1)
            cell->ends |= !add_to_front(cell->worker, across / 4);
    }
}

/* From one tetrahedron of the second mesh to the next. Returns whether there are no others, because each place is
 * covered once: these cover all of the first's volume, or the second mesh did not end on the way. */
static bool compare_front(struct overlap *cell, const struct weights_map *map)
{
    struct measuring *measuring = cell->measuring;
    struct overlap_worker *worker = cell->worker;
    uint32_t first = !measuring->bodies[0] ? find_first(measuring, cell->tets[0]) : TETLOD_NONE;
    worker->front_count = 0;
    cell->ends = first == TETLOD_NONE || !add_to_front(worker, first);
    while (worker->front_count) {
        uint32_t tet = cell->tets[1] = worker->front[--worker->front_count];
        if (worker->seen[tet] != cell->tets[0] + 1 && overlap_compare(cell, map))
            go_on(cell, tet);
    }
    return cell->covered >= cell->volumes[0] * (1 - COVERED) || (measuring->open->asked && !cell->ends);
}

static void compare_range(void *context, unsigned number, size_t begin, size_t end)
{
    struct measuring *measuring = context;
    const struct tetmesh *a = measuring->sides[0].mesh;
    for (size_t tet = begin; tet < end; tet++) {
        struct overlap_worker *worker = &measuring->workers[number];
        struct difference_cell *out = &measuring->out->cells[tet];
        struct overlap cell = {.measuring = measuring, .worker = worker, .tets = {(uint32_t)tet, 0}};
        struct reach reach;
        uint32_t first, last;
        const bool asked = !measuring->open->asked || measuring->pairing ||
            measuring->open->asked[tet] == measuring->stage;
        if (!measuring->usable[0][tet] || !asked)
            continue;
        cell.volumes[0] = overlap_volume(a, (uint32_t)tet);
        if (measuring->same) {
            overlap_compare_self(&cell);
            continue;
        }
        reach_set(&reach, a, (uint32_t)tet);
        if (compare_front(&cell, &reach.map))
            continue;
        out->left = true; // the rest may be in the second original
        struct bvh_walk walk = bvh_walk_begin(&measuring->tree);
        while (bvh_next_leaf_where(&walk, reaches, &reach, &first, &last))
            for (uint32_t i = first; i < last; i++) {
                cell.tets[1] = measuring->tree.order[i];
                if (worker->seen[cell.tets[1]] != tet + 1)
                    overlap_compare(&cell, &reach.map);
            }
    }
}

/* ---- before and behind */

static enum tetlod_status find_usable(struct measuring *measuring, int m, const uint32_t *neighbours,
                                      struct tetlod_error *error)
{
    const struct tetmesh *mesh = measuring->sides[m].mesh;
    struct sheets sheets;
    TETLOD_TRY(sheets_find(&sheets, mesh, neighbours, error));
    measuring->usable[m] = sheets.promised;
    sheets.promised = NULL;
    sheets_fini(&sheets);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        measuring->out->left_out[m] += !measuring->usable[m][t];
        measuring->out->volumes[m] += measuring->usable[m][t] ? overlap_volume(mesh, t) : 0;
    }
    return TETLOD_OK;
}

/* Bodies of tetrahedra, numbered from 0; returns how many there are, 0 if memory is out. */
static uint32_t number_bodies(struct measuring *measuring, int m)
{
    const struct tetmesh *mesh = measuring->sides[m].mesh;
    uint32_t *roots = array_new(mesh->vertex_count, sizeof *roots), *numbers, count = 0;
    measuring->bodies[m] = array_new(mesh->tet_count, sizeof **measuring->bodies);
    numbers = array_new(mesh->vertex_count, sizeof *numbers);
    if (roots && numbers && measuring->bodies[m]) {
        sheets_bodies(mesh->corners, mesh->tet_count, mesh->vertex_count, roots);
        for (uint32_t v = 0; v < mesh->vertex_count; v++) // a root is its body's first vertex
            numbers[v] = roots[v] == v ? count++ : TETLOD_NONE;
        for (uint32_t t = 0; t < mesh->tet_count; t++)
            measuring->bodies[m][t] = numbers[roots[mesh->corners[4 * (size_t)t]]];
    }
    free(roots);
    free(numbers);
    return count;
}

static enum tetlod_status find_bodies(struct measuring *measuring, struct tetlod_error *error)
{
    uint32_t counts[2];
    for (int m = 0; m < 2; m++) {
        const struct tetmesh *mesh = measuring->sides[m].mesh;
        counts[m] = number_bodies(measuring, m);
        measuring->body_volumes[m] = array_zero(counts[m], sizeof **measuring->body_volumes);
        if (!counts[m] || !measuring->body_volumes[m])
            return tetlodi_fail_nomem(error, "the bodies", mesh->vertex_count * (uint64_t)12);
        for (uint32_t t = 0; t < mesh->tet_count; t++)
            if (measuring->usable[m][t])
                measuring->body_volumes[m][measuring->bodies[m][t]] +=
                    (uint64_t)(overlap_volume(mesh, t) / measuring->unit);
    }
    if (counts[0] != 1 || counts[1] != 1)
        return TETLOD_OK;
    for (int m = 0; m < 2; m++) {
        free(measuring->bodies[m]);
        measuring->bodies[m] = NULL;
    }
    return TETLOD_OK;
}

static enum tetlod_status find_near(struct measuring *measuring, int m, const uint32_t *neighbours,
                                    struct tetlod_error *error)
{
    const struct difference_side *side = &measuring->sides[m];
    TETLOD_TRY(moved_boundary_find(&measuring->out->boundaries[m], side->mesh, neighbours, side->moved, error));
    measuring->near[m] = array_new(side->mesh->tet_count, sizeof **measuring->near);
    if (!measuring->near[m])
        return tetlodi_fail_nomem(error, "the overlay", side->mesh->tet_count);
    for (uint32_t t = 0; t < side->mesh->tet_count; t++) {
        double box[6];
        if (m == 0 && measuring->open->asked && measuring->open->asked[t] == ASKED_NOT)
            continue;
        tet_box(side->mesh, t, box);
        measuring->near[m][t] = !moved_boundary_leaves_box(&measuring->out->boundaries[m], box);
    }
    return TETLOD_OK;
}

/* Its neighbours, of which those of the second mesh lead the search on, and what they tell. */
static enum tetlod_status prepare_side(struct measuring *measuring, int m, struct tetlod_error *error)
{
    const struct tetmesh *mesh = measuring->sides[m].mesh;
    uint32_t *neighbours = array_new(mesh->tet_count, 4 * sizeof *neighbours);
    if (!neighbours)
        return tetlodi_fail_nomem(error, "the overlay", mesh->tet_count * (uint64_t)16);
    enum tetlod_status status = adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL,
                                                error);
    if (status == TETLOD_OK)
        status = find_usable(measuring, m, neighbours, error);
    if (status == TETLOD_OK && measuring->sides[m].moved > 0)
        status = find_near(measuring, m, neighbours, error);
    if (m == 1)
        measuring->neighbours = neighbours;
    else
        free(neighbours);
    return status;
}

/* The second mesh, to be searched. */
static enum tetlod_status prepare_search(struct measuring *measuring, struct tetlod_error *error)
{
    const struct tetmesh *b = measuring->sides[1].mesh;
    measuring->maps = array_new(b->tet_count, sizeof *measuring->maps);
    measuring->volumes = array_new(b->tet_count, sizeof *measuring->volumes);
    if (!measuring->maps || !measuring->volumes)
        return tetlodi_fail_nomem(error, "the overlay", b->tet_count * (uint64_t)sizeof *measuring->maps);
    for (uint32_t t = 0; t < b->tet_count; t++) {
        make_map(b, t, &measuring->maps[t]);
        measuring->volumes[t] = overlap_volume(b, t);
    }
    return bvh_build(&measuring->tree, b->positions, b->corners, b->tet_count, 4, BVH_LEAF, error);
}

enum { PARTS = 3 };

/* What is prepared at the same time. */
struct preparation {
    struct measuring *measuring;
    enum tetlod_status status[PARTS];
    struct tetlod_error errors[PARTS];
};

static void prepare_part(void *context, unsigned worker, size_t begin, size_t end)
{
    struct preparation *preparation = context;
    struct measuring *measuring = preparation->measuring;
    (void)worker;
    for (size_t part = begin; part < end; part++) {
        struct tetlod_error *error = &preparation->errors[part];
        if (part < 2)
            preparation->status[part] = prepare_side(measuring, (int)part, error);
        else if (!measuring->same)
            preparation->status[part] = prepare_search(measuring, error);
    }
}

static enum tetlod_status prepare(struct measuring *measuring, unsigned threads, struct tetlod_error *error)
{
    struct preparation preparation = {.measuring = measuring};
    parallel_for(threads, PARTS, 1, prepare_part, &preparation);
    for (int part = 0; part < PARTS; part++)
        if (preparation.status[part] != TETLOD_OK) {
            *error = preparation.errors[part];
            return preparation.status[part];
        }
    measuring->unit = (measuring->out->volumes[0] + measuring->out->volumes[1]) / 0x1p52;
    return measuring->same ? TETLOD_OK : find_bodies(measuring, error);
}

static enum tetlod_status prepare_workers(struct measuring *measuring, unsigned threads, struct tetlod_error *error)
{
    measuring->workers = array_zero(threads, sizeof *measuring->workers);
    for (unsigned w = 0; w < threads && measuring->workers; w++) {
        measuring->workers[w].lower = -INFINITY;
        uint32_t tets = measuring->sides[1].mesh->tet_count;
        measuring->workers[w].differences = array_new(measuring->components, 4 * sizeof(double));
        measuring->workers[w].seen = array_zero(tets, sizeof(uint32_t));
        if (!measuring->workers[w].differences || !measuring->workers[w].seen)
            return tetlodi_fail_nomem(error, "the overlay", measuring->components * (uint64_t)32 + tets * (uint64_t)4);
    }
    return measuring->workers ? TETLOD_OK
                              : tetlodi_fail_nomem(error, "the overlay", threads * sizeof *measuring->workers);
}

/* Which bodies are each other's. */
static enum tetlod_status pair_bodies(struct measuring *measuring, unsigned threads, struct tetlod_error *error)
{
    if (!measuring->bodies[0])
        return TETLOD_OK;
    bool room = true;
    measuring->pairing = true;
    parallel_for(threads, measuring->sides[0].mesh->tet_count, CHUNK, compare_range, measuring);
    measuring->pairing = false;
    for (unsigned w = 0; w < threads; w++) {
        memset(measuring->workers[w].seen, 0, measuring->sides[1].mesh->tet_count * sizeof(uint32_t));
        const struct body_pairs *own = &measuring->workers[w].pairs;
        room = room && !measuring->workers[w].no_memory;
        for (size_t i = 0; i < own->count && room; i++)
            room = body_pairs_add(&measuring->pairs, own->pairs[i].bodies[0], own->pairs[i].bodies[1],
                                  own->pairs[i].volume);
    }
    if (!room)
        return tetlodi_fail_nomem(error, "the bodies", measuring->pairs.count * (uint64_t)sizeof(struct body_pair));
    body_pairs_judge(&measuring->pairs,
                     (const uint64_t *const[]){measuring->body_volumes[0], measuring->body_volumes[1]});
    return TETLOD_OK;
}

/* A difference that is no less than any: what the ranges allow. */
static double furthest_of(const struct difference_side sides[2])
{
    return larger(sides[0].range[1] - sides[1].range[0], sides[1].range[1] - sides[0].range[0]);
}

/* Places that boundaries have left: with a field of which nothing is known there, or among several bodies, which the
 * boundaries may have parted, what the ranges allow. */
static void compare_shell(struct measuring *measuring, unsigned threads)
{
    const struct difference_side *sides = measuring->sides;
    struct boundary_shell_side given[2];
    bool moves = false, known = !measuring->bodies[0];
    for (int m = 0; m < 2; m++) {
        given[m] = (struct boundary_shell_side){sides[m].mesh, &measuring->out->boundaries[m], measuring->usable[m],
                                       measuring->values[m]};
        moves = moves || sides[m].moved > 0;
        known = known && isfinite(sides[m].moved) && (sides[m].has_partners || !(sides[m].moved > 0));
        measuring->out->swept += sides[m].moved > 0 ? smaller(sides[m].swept, measuring->out->boundaries[m].shell) : 0;
    }
    if (!moves)
        return;
    measuring->out->shell = furthest_of(sides);
    if (!known)
        return;
    // what is within the limit needs no more to be known of
    const double errors = sides[0].error + sides[1].error;
    double most = measuring->open->asked ? larger(measuring->open->limit * (1 - ROUNDING) - errors, 0) : 0;
    most = boundary_shell_difference(given, measuring->stride, measuring->components, most, threads);
    measuring->out->shell = smaller(measuring->out->shell, errors + most);
}

/* All that is asked, in two stages if the first may decide. */
static void compare_all(struct measuring *measuring, unsigned threads)
{
    const size_t tets = measuring->sides[0].mesh->tet_count;
    const bool staged = measuring->open->asked != NULL;
    double lower = -INFINITY;
    for (measuring->stage = staged ? ASKED_FIRST : ASKED_LAST; measuring->stage > ASKED_NOT; measuring->stage--) {
        parallel_for(threads, tets, CHUNK, compare_range, measuring);
        for (unsigned w = 0; w < threads; w++)
            lower = larger(lower, measuring->workers[w].lower);
        if (staged && measuring->stage == ASKED_FIRST && lower > measuring->open->limit) {
            measuring->out->decided = true;
            return;
        }
    }
    compare_shell(measuring, threads);
}

static void add_up(struct measuring *measuring, unsigned threads)
{
    struct difference *out = measuring->out;
    size_t tet = SIZE_MAX;
    for (uint32_t t = 0; t < measuring->sides[0].mesh->tet_count; t++) {
        const struct difference_cell *cell = &out->cells[t];
        out->overlap += cell->volume;
        out->inner = larger(out->inner, cell->upper);
        for (int end = 0; end < 2; end++)
            out->squares[end] += cell->squares[end];
    }
    for (unsigned w = 0; w < threads; w++) {
        const struct overlap_worker *worker = &measuring->workers[w];
        out->apart += (double)worker->apart * measuring->unit;
        if (worker->lower < out->max[0] || (worker->lower == out->max[0] && worker->tet > tet))
            continue;
        out->max[0] = worker->lower;
        tet = worker->tet;
        memcpy(out->place, worker->place, sizeof out->place);
    }
    out->max[1] = larger(out->inner, out->shell);
    out->one_body = !measuring->bodies[0];
    out->squares[0] *= 1 - ROUNDING;
    out->squares[1] *= 1 + ROUNDING;
}

static void release(struct measuring *measuring, unsigned threads)
{
    for (int m = 0; m < 2; m++) {
        free(measuring->usable[m]);
        free(measuring->bodies[m]);
        free(measuring->body_volumes[m]);
        free(measuring->near[m]);
    }
    for (unsigned w = 0; w < threads && measuring->workers; w++) {
        free(measuring->workers[w].differences);
        free(measuring->workers[w].seen);
        free(measuring->workers[w].front);
        body_pairs_fini(&measuring->workers[w].pairs);
    }
    free(measuring->workers);
    free(measuring->maps);
    free(measuring->volumes);
    free(measuring->neighbours);
    bvh_fini(&measuring->tree);
    body_pairs_fini(&measuring->pairs);
}

static void begin(struct measuring *measuring, int component)
{
    const struct difference_side *sides = measuring->sides;
    const struct point_field *field = &sides[0].mesh->fields[sides[0].field];
    measuring->same = mesh_same_order(sides[0].mesh, sides[1].mesh);
    measuring->stride = field->components;
    measuring->components = component < 0 ? field->components : 1;
    for (int m = 0; m < 2; m++) {
        const struct tetmesh *mesh = sides[m].mesh;
        measuring->values[m] = mesh->fields[sides[m].field].values + (component < 0 ? 0 : component);
        measuring->bounds[m] = sides[m].bound == TETLOD_NONE ? NULL : mesh->fields[sides[m].bound].values;
    }
}

enum tetlod_status difference_measure(struct difference *out, const struct difference_side sides[2], int component,
                                      const struct difference_open *open, unsigned threads,
                                      struct tetlod_error *error)
{
    struct measuring measuring = {.sides = sides, .open = open, .out = out};
    const struct tetmesh *a = sides[0].mesh;
    enum tetlod_status status = TETLOD_OK;
    threads = threads < 1 ? 1 : threads > PARALLEL_MAX_THREADS ? PARALLEL_MAX_THREADS : threads;
    *out = (struct difference){.cells = array_zero(a->tet_count, sizeof *out->cells)};
    if (!out->cells)
        return tetlodi_fail_nomem(error, "the difference", a->tet_count * (uint64_t)sizeof *out->cells);
    begin(&measuring, component);
    TETLOD_TRY_DONE(prepare(&measuring, threads, error));
    TETLOD_TRY_DONE(prepare_workers(&measuring, threads, error));
    TETLOD_TRY_DONE(pair_bodies(&measuring, threads, error));
    compare_all(&measuring, threads);
    add_up(&measuring, threads);
done:
    release(&measuring, threads);
    return status;
}

void difference_fini(struct difference *difference)
{
    for (int m = 0; m < 2; m++)
        moved_boundary_fini(&difference->boundaries[m]);
    free(difference->cells);
    *difference = (struct difference){0};
}
