/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/difference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/ask/clip.h"
#include "src/diff/bodies.h"
#include "src/measure/weights_map.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/bvh.h"
#include "src/mesh/sheets.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

enum { CHUNK = 64, BINS = 4096 };

/* A cell of less than this of the smaller tetrahedron is a sliver. */
static const double SLIVER = 0.01;

/* A pair whose weights may be wrong by more than this is not clipped. */
static const double HOPELESS = 1e-4;

/* A tetrahedron is covered if no more than this of it is left. */
static const double COVERED = 1e-9;

/* What rounding makes of sums and of their division: of the sums. */
static const double ROUNDING = 1e-9;

/* One thread's. */
struct worker {
    double *differences;       /* [4 * components] at the corners of the clipped tetrahedron */
    uint32_t *seen;            /* [tet of the second mesh] the last of the first that it was compared with, and 1 */
    uint32_t *front;           /* those that are to be compared */
    size_t front_count, front_capacity;
    struct body_pairs pairs;
    double lower, place[3];    /* the greatest lower end, and where */
    size_t tet;                /* of the first mesh, that has it */
    uint64_t bins[BINS];       /* volume, by what the difference is at least */
    uint64_t apart;
    bool no_memory;
};

struct measuring {
    const struct difference_side *sides;
    const double *values[2], *bounds[2];
    uint32_t stride, components;
    uint8_t *usable[2];        /* owned, [tet] */
    uint32_t *bodies[2];       /* owned, [tet]; NULL: each mesh is one body */
    uint64_t *body_volumes[2]; /* owned, [body] */
    double *volumes;           /* owned, [tet of the second mesh] */
    struct weights_map *maps;  /* owned, [tet of the second mesh] */
    struct bvh tree;           /* of it */
    uint32_t *neighbours;      /* owned, of it (adjacency.h) */
    bool same;                 /* the meshes are: only tetrahedra of the same number overlap */
    bool pairing;              /* only which bodies overlap is asked */
    struct body_pairs pairs;   /* judged */
    double unit, bin;          /* of volumes; the width of a bin */
    struct worker *workers;
    struct difference *out;
};

/* Two tetrahedra that may overlap, and what has come together of their cell. */
struct cell {
    struct measuring *measuring;
    struct worker *worker;
    uint32_t tets[2];
    int clipped;            /* whose corners the pieces' weights are of */
    double in[2][4][4];     /* weights of each one's corners in the other */
    double volumes[2], slack, noise;
    double errors[4];       /* bounds at the corners of the clipped one */
    double reach[2][4];     /* the greatest weights in the cell */
    double share, integral, square, error_square;
    double upper, lower, least; /* least: of the difference anywhere in it, less the bounds */
    double weights[4];      /* where `lower` is */
};

/* ---- a cell */

/* The largest component's difference at a piece's corners, and its least one in between. */
static void add_component(struct cell *cell, const double piece[4][4], const double errors[4], uint32_t c,
                          double share, double *least)
{
    const double *at = cell->worker->differences + 4 * (size_t)c;
    double d[4], sum = 0, squares = 0, low = INFINITY;
    for (int i = 0; i < 4; i++) {
        d[i] = piece[i][0] * at[0] + piece[i][1] * at[1] + piece[i][2] * at[2] + piece[i][3] * at[3];
        sum += d[i];
        squares += d[i] * d[i];
        low = smaller(low, fabs(d[i]));
        cell->upper = larger(cell->upper, fabs(d[i]) + errors[i]);
        if (fabs(d[i]) - errors[i] > cell->lower) {
            cell->lower = fabs(d[i]) - errors[i];
            memcpy(cell->weights, piece[i], sizeof cell->weights);
        }
    }
    cell->square += share * (squares + sum * sum) / 20;
    cell->integral += c == 0 ? share * sum / 4 : 0;
    bool turns = !((d[0] > 0 && d[1] > 0 && d[2] > 0 && d[3] > 0) || (d[0] < 0 && d[1] < 0 && d[2] < 0 && d[3] < 0));
    *least = larger(*least, turns ? 0 : low);
}

static void add_piece(void *opaque, const double piece[4][4])
{
    struct cell *cell = opaque;
    const struct measuring *measuring = cell->measuring;
    int own = cell->clipped;
    double share = clip_share(piece), errors[4], sum = 0, squares = 0, most = 0, least = 0;
    for (int i = 0; i < 4; i++) {
        const double *w = piece[i], *e = cell->errors;
        for (int k = 0; k < 4; k++) {
            double other = 0;
            for (int c = 0; c < 4; c++)
                other += w[c] * cell->in[own][c][k];
            cell->reach[own][k] = larger(cell->reach[own][k], w[k]);
            cell->reach[!own][k] = larger(cell->reach[!own][k], other);
        }
        errors[i] = larger(w[0] * e[0] + w[1] * e[1] + w[2] * e[2] + w[3] * e[3], 0);
        sum += errors[i];
        squares += errors[i] * errors[i];
        most = larger(most, errors[i]);
    }
    cell->share += share;
    cell->error_square += measuring->components * share * (squares + sum * sum) / 20;
    for (uint32_t c = 0; c < measuring->components && !measuring->pairing; c++)
        add_component(cell, piece, errors, c, share, &least);
    cell->least = smaller(cell->least, least - most);
}

static const double *values_at(const struct measuring *measuring, int m, uint32_t tet, int k)
{
    size_t vertex = measuring->sides[m].mesh->corners[4 * (size_t)tet + (size_t)k];
    return measuring->values[m] + vertex * measuring->stride;
}

static double bound_at(const struct measuring *measuring, int m, uint32_t tet, int k)
{
    size_t vertex = measuring->sides[m].mesh->corners[4 * (size_t)tet + (size_t)k];
    return measuring->bounds[m] ? measuring->bounds[m][vertex] : measuring->sides[m].error;
}

/* Differences and bounds at the corners of the clipped tetrahedron: the other one's functions are continued to there.
 * Values are taken less one of them, so that rounding is about what varies. */
static void gather(struct cell *cell)
{
    const struct measuring *measuring = cell->measuring;
    int own = cell->clipped, other = !own;
    double size = 0;
    for (int k = 0; k < 4; k++) {
        cell->errors[k] = bound_at(measuring, own, cell->tets[own], k);
        for (int j = 0; j < 4; j++)
            cell->errors[k] += cell->in[own][k][j] * bound_at(measuring, other, cell->tets[other], j);
        size = larger(size, bound_at(measuring, 0, cell->tets[0], k) + bound_at(measuring, 1, cell->tets[1], k));
    }
    for (uint32_t c = 0; c < measuring->components; c++) {
        double base = measuring->same ? 0 : values_at(measuring, 0, cell->tets[0], 0)[c], v[2][4];
        for (int m = 0; m < 2; m++)
            for (int k = 0; k < 4; k++) {
                v[m][k] = values_at(measuring, m, cell->tets[m], k)[c] - base;
                size = larger(size, fabs(v[m][k]));
            }
        for (int k = 0; k < 4; k++) {
            const double *in = cell->in[own][k];
            double sum = in[0] * v[other][0] + in[1] * v[other][1] + in[2] * v[other][2] + in[3] * v[other][3];
            sum = measuring->same ? v[other][k] : sum; // without rounding
            cell->worker->differences[4 * c + (unsigned)k] = own ? sum - v[own][k] : v[own][k] - sum;
        }
    }
    cell->noise = 32 * size * cell->slack;
}

/* Where weights mean nothing: the difference is no more than that of any two corners. */
static void add_hopeless(struct cell *cell)
{
    const struct measuring *measuring = cell->measuring;
    struct difference_cell *out = &measuring->out->cells[cell->tets[0]];
    double most = 0, error = 0;
    for (uint32_t c = 0; c < measuring->components; c++)
        for (int i = 0; i < 16; i++)
            most = larger(most, fabs(values_at(measuring, 0, cell->tets[0], i / 4)[c] -
                                     values_at(measuring, 1, cell->tets[1], i % 4)[c]));
    for (int m = 0; m < 2; m++)
        for (int k = 0; k < 4; k++)
            error = larger(error, bound_at(measuring, m, cell->tets[m], k));
    most += 2 * error;
    out->upper = larger(out->upper, most);
    out->squares[1] += smaller(cell->volumes[0], cell->volumes[1]) * measuring->components * most * most;
}

static void keep_place(const struct cell *cell, double lower)
{
    struct worker *worker = cell->worker;
    if (!(lower > worker->lower || (lower == worker->lower && cell->tets[0] < worker->tet)))
        return;
    worker->lower = lower;
    worker->tet = cell->tets[0];
    memset(worker->place, 0, sizeof worker->place);
    for (int c = 0; c < 4; c++) {
        const double *p = mesh_corner(cell->measuring->sides[cell->clipped].mesh, cell->tets[cell->clipped], c);
        for (int i = 0; i < 3; i++)
            worker->place[i] += cell->weights[c] * p[i];
    }
}

/* What the cell's pieces have come to counts for the tetrahedron of the first mesh. */
static void add_cell(const struct cell *cell)
{
    const struct measuring *measuring = cell->measuring;
    struct difference_cell *out = &measuring->out->cells[cell->tets[0]];
    double volume = cell->volumes[cell->clipped] * cell->share;
    double root = sqrt(cell->volumes[cell->clipped]), more = cell->noise * sqrt(volume * measuring->components);
    double own = root * sqrt(cell->square), by = root * sqrt(cell->error_square) + more;
    double low = larger(own - by, 0), high = own + by;
    out->volume += volume;
    out->integral += cell->volumes[cell->clipped] * cell->integral;
    out->squares[0] += low * low;
    out->squares[1] += high * high;
    out->upper = larger(out->upper, cell->upper + cell->noise);
    if (volume < SLIVER * smaller(cell->volumes[0], cell->volumes[1]))
        return;
    double lower = cell->lower - cell->noise, least = cell->least - cell->noise;
    out->lower = larger(out->lower, lower);
    keep_place(cell, lower);
    if (measuring->bin > 0 && least > 0) {
        double bin = floor(least / measuring->bin);
        cell->worker->bins[bin < BINS - 1 ? (int)bin : BINS - 1] += (uint64_t)(volume / measuring->unit);
    }
}

/* Is the cell more than a contact? In both tetrahedra it reaches inside from every face. */
static bool is_overlap(const struct cell *cell)
{
    double least = 1;
    for (int m = 0; m < 2; m++)
        for (int k = 0; k < 4; k++)
            least = smaller(least, cell->reach[m][k]);
    return least > THIN + (cell->slack < THIN ? 3 * cell->slack : 0);
}

/* Of bodies that are not each other's nothing is compared. False: so it is. */
static bool compares(const struct cell *cell, double volume)
{
    const struct measuring *measuring = cell->measuring;
    struct worker *worker = cell->worker;
    if (!measuring->bodies[0])
        return true;
    uint32_t a = measuring->bodies[0][cell->tets[0]], b = measuring->bodies[1][cell->tets[1]];
    uint64_t units = (uint64_t)(volume / measuring->unit);
    if (measuring->pairing) {
        worker->no_memory |= !body_pairs_add(&worker->pairs, a, b, units);
        return false;
    }
    bool kept = body_pairs_kept(&measuring->pairs, a, b);
    worker->apart += kept ? 0 : units;
    return kept;
}

/* Returns the cell's volume; 0 for a contact. */
static double clip_cell(struct cell *cell)
{
    double planes[4][4];
    unsigned count = 0;
    int own = cell->clipped;
    for (int k = 0; k < 4; k++) {
        double least = 1;
        for (int c = 0; c < 4; c++) {
            planes[count][c] = cell->in[own][c][k] + 2 * cell->slack;
            least = smaller(least, planes[count][c]);
        }
        count += least < 0;
    }
    memset(cell->reach, 0, sizeof cell->reach);
    cell->share = cell->integral = cell->square = cell->error_square = cell->upper = 0;
    cell->lower = -INFINITY;
    cell->least = INFINITY;
    gather(cell);
    clip_tet((const double(*)[4])planes, count, add_piece, cell);
    if (!is_overlap(cell))
        return 0;
    if (compares(cell, cell->volumes[own] * cell->share))
        add_cell(cell);
    return cell->volumes[own] * cell->share;
}

/* ---- all cells */

static double volume_of(const struct tetmesh *mesh, uint32_t tet)
{
    return fabs(tet_volume6(mesh_corner(mesh, tet, 0), mesh_corner(mesh, tet, 1), mesh_corner(mesh, tet, 2),
                            mesh_corner(mesh, tet, 3))) / 6;
}

/* Returns what both cover; 0: they touch at most. */
static double compare_pair(struct cell *cell, const struct weights_map *map)
{
    struct measuring *measuring = cell->measuring;
    const struct tetmesh *a = measuring->sides[0].mesh, *b = measuring->sides[1].mesh;
    double slacks[2];
    cell->worker->seen[cell->tets[1]] = cell->tets[0] + 1;
    if (!measuring->usable[1][cell->tets[1]] || !weigh_corners(map, b, cell->tets[1], cell->in[1], &slacks[1]) ||
        !weigh_corners(&measuring->maps[cell->tets[1]], a, cell->tets[0], cell->in[0], &slacks[0]))
        return 0;
    cell->volumes[1] = measuring->volumes[cell->tets[1]];
    cell->clipped = slacks[1] < slacks[0];
    cell->slack = slacks[cell->clipped];
    if (cell->slack <= HOPELESS)
        return clip_cell(cell);
    if (compares(cell, 0))
        add_hopeless(cell);
    return 0;
}

static void compare_self(struct cell *cell)
{
    static const double whole[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    memcpy(cell->in[0], whole, sizeof whole);
    cell->tets[1] = cell->tets[0];
    cell->volumes[1] = cell->volumes[0];
    cell->clipped = 0;
    cell->slack = 0;
    clip_cell(cell);
}

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

static void add_to_front(struct worker *worker, uint32_t tet)
{
    if (array_reserve((void **)&worker->front, &worker->front_capacity, worker->front_count + 1, sizeof tet))
        worker->front[worker->front_count++] = tet;
    // else it is found by the search, which takes longer
}

/* From a tetrahedron of the second mesh to those beside it, across the faces that the one of the first reaches behind.
 * Returns what they cover: if that is all of it, there are no others, because each place is covered once. */
static double compare_front(struct cell *cell, const struct weights_map *map)
{
    struct measuring *measuring = cell->measuring;
    struct worker *worker = cell->worker;
    double covered = 0;
    uint32_t first = !measuring->bodies[0] ? find_first(measuring, cell->tets[0]) : TETLOD_NONE;
    worker->front_count = 0;
    if (first != TETLOD_NONE)
        add_to_front(worker, first);
    while (worker->front_count) {
        uint32_t tet = cell->tets[1] = worker->front[--worker->front_count];
        double volume = worker->seen[tet] == cell->tets[0] + 1 ? 0 : compare_pair(cell, map);
        covered += volume;
        for (int k = 0; k < 4 && volume > 0; k++) {
            uint32_t across = measuring->neighbours[4 * (size_t)tet + (size_t)k];
            double least = smaller(smaller(cell->in[0][0][k], cell->in[0][1][k]),
                                   smaller(cell->in[0][2][k], cell->in[0][3][k]));
            if (across != TETLOD_NONE && least < -THIN && worker->seen[across / 4] != cell->tets[0] + 1)
                add_to_front(worker, across / 4);
        }
    }
    return covered;
}

static void compare_range(void *context, unsigned number, size_t begin, size_t end)
{
    struct measuring *measuring = context;
    const struct tetmesh *a = measuring->sides[0].mesh;
    for (size_t tet = begin; tet < end; tet++) {
        struct worker *worker = &measuring->workers[number];
        struct cell cell = {.measuring = measuring, .worker = worker, .tets = {(uint32_t)tet, 0}};
        struct reach reach;
        uint32_t first, last;
        if (!measuring->usable[0][tet])
            continue;
        cell.volumes[0] = volume_of(a, (uint32_t)tet);
        if (measuring->same) {
            compare_self(&cell);
            continue;
        }
        reach_set(&reach, a, (uint32_t)tet);
        if (compare_front(&cell, &reach.map) >= cell.volumes[0] * (1 - COVERED))
            continue;
        struct bvh_walk walk = bvh_walk_begin(&measuring->tree);
        while (bvh_next_leaf_where(&walk, reaches, &reach, &first, &last))
            for (uint32_t i = first; i < last; i++) {
                cell.tets[1] = measuring->tree.order[i];
                if (worker->seen[cell.tets[1]] != tet + 1)
                    compare_pair(&cell, &reach.map);
            }
    }
}

/* ---- before and behind */

static enum tetlod_status find_usable(struct measuring *measuring, int m, struct tetlod_error *error)
{
    const struct tetmesh *mesh = measuring->sides[m].mesh;
    struct sheets sheets;
    TETLOD_TRY(sheets_find(&sheets, mesh, error));
    measuring->usable[m] = sheets.promised;
    sheets.promised = NULL;
    sheets_fini(&sheets);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        measuring->out->left_out[m] += !measuring->usable[m][t];
        measuring->out->volumes[m] += measuring->usable[m][t] ? volume_of(mesh, t) : 0;
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
                measuring->body_volumes[m][measuring->bodies[m][t]] += (uint64_t)(volume_of(mesh, t) / measuring->unit);
    }
    if (counts[0] != 1 || counts[1] != 1)
        return TETLOD_OK;
    for (int m = 0; m < 2; m++) {
        free(measuring->bodies[m]);
        measuring->bodies[m] = NULL;
    }
    return TETLOD_OK;
}

/* Of the second mesh, from which the search goes on. */
static enum tetlod_status find_neighbours(struct measuring *measuring, struct tetlod_error *error)
{
    const struct tetmesh *b = measuring->sides[1].mesh;
    measuring->neighbours = array_new(b->tet_count, 4 * sizeof *measuring->neighbours);
    if (!measuring->neighbours)
        return tetlodi_fail_nomem(error, "the overlay", b->tet_count * (uint64_t)16);
    return adjacency_build(b->corners, b->tet_count, b->vertex_count, measuring->neighbours, NULL, error);
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
        measuring->volumes[t] = volume_of(b, t);
    }
    return bvh_build(&measuring->tree, b->positions, b->corners, b->tet_count, 4, BVH_LEAF, error);
}

/* What is prepared at the same time. */
struct preparation {
    struct measuring *measuring;
    enum tetlod_status status[4];
    struct tetlod_error errors[4];
};

static void prepare_part(void *context, unsigned worker, size_t begin, size_t end)
{
    struct preparation *preparation = context;
    struct measuring *measuring = preparation->measuring;
    (void)worker;
    for (size_t part = begin; part < end; part++) {
        struct tetlod_error *error = &preparation->errors[part];
        if (part < 2)
            preparation->status[part] = find_usable(measuring, (int)part, error);
        else if (!measuring->same)
            preparation->status[part] = part == 2 ? prepare_search(measuring, error)
                                                  : find_neighbours(measuring, error);
    }
}

static enum tetlod_status prepare(struct measuring *measuring, unsigned threads, struct tetlod_error *error)
{
    struct preparation preparation = {.measuring = measuring};
    parallel_for(threads, 4, 1, prepare_part, &preparation);
    for (int part = 0; part < 4; part++)
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
    return measuring->workers ? TETLOD_OK : tetlodi_fail_nomem(error, "the overlay", threads * sizeof(struct worker));
}

/* The width of a bin: of all that a difference can be. 0: nothing was swept, and none are needed. */
static double bin_width(const struct measuring *measuring)
{
    double least = INFINITY, most = -INFINITY;
    if (!(measuring->sides[0].swept + measuring->sides[1].swept > 0))
        return 0;
    for (int m = 0; m < 2; m++) {
        const struct tetmesh *mesh = measuring->sides[m].mesh;
        for (size_t v = 0; v < mesh->vertex_count; v++)
            for (uint32_t c = 0; c < measuring->components; c++) {
                least = smaller(least, measuring->values[m][v * measuring->stride + c]);
                most = larger(most, measuring->values[m][v * measuring->stride + c]);
            }
    }
    return (most - least) / BINS;
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

/* The largest difference that more than the swept volumes have: of the volume that has it, some was not swept. */
static double differing(const struct measuring *measuring, unsigned threads)
{
    double swept = (measuring->sides[0].swept + measuring->sides[1].swept) * (1 + ROUNDING), volume = 0;
    for (int bin = BINS - 1; bin >= 0 && measuring->bin > 0; bin--) {
        for (unsigned w = 0; w < threads; w++)
            volume += (double)measuring->workers[w].bins[bin] * measuring->unit;
        if (volume > swept)
            return bin * measuring->bin;
    }
    return 0;
}

static void add_up(struct measuring *measuring, unsigned threads)
{
    struct difference *out = measuring->out;
    size_t tet = SIZE_MAX;
    for (uint32_t t = 0; t < measuring->sides[0].mesh->tet_count; t++) {
        const struct difference_cell *cell = &out->cells[t];
        out->overlap += cell->volume;
        out->max[1] = larger(out->max[1], cell->upper);
        for (int end = 0; end < 2; end++)
            out->squares[end] += cell->squares[end];
    }
    for (unsigned w = 0; w < threads; w++) {
        const struct worker *worker = &measuring->workers[w];
        out->apart += (double)worker->apart * measuring->unit;
        if (worker->lower < out->max[0] || (worker->lower == out->max[0] && worker->tet > tet))
            continue;
        out->max[0] = worker->lower;
        tet = worker->tet;
        memcpy(out->place, worker->place, sizeof out->place);
    }
    out->squares[0] *= 1 - ROUNDING;
    out->squares[1] *= 1 + ROUNDING;
    out->differing = differing(measuring, threads);
}

static void release(struct measuring *measuring, unsigned threads)
{
    for (int m = 0; m < 2; m++) {
        free(measuring->usable[m]);
        free(measuring->bodies[m]);
        free(measuring->body_volumes[m]);
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

static bool are_same(const struct tetmesh *a, const struct tetmesh *b)
{
    return a->vertex_count == b->vertex_count && a->tet_count == b->tet_count &&
        memcmp(a->positions, b->positions, a->vertex_count * 3 * sizeof *a->positions) == 0 &&
        memcmp(a->corners, b->corners, a->tet_count * 4 * sizeof *a->corners) == 0;
}

static void begin(struct measuring *measuring, int component)
{
    const struct difference_side *sides = measuring->sides;
    const struct point_field *field = &sides[0].mesh->fields[sides[0].field];
    measuring->same = are_same(sides[0].mesh, sides[1].mesh);
    measuring->stride = field->components;
    measuring->components = component < 0 ? field->components : 1;
    for (int m = 0; m < 2; m++) {
        const struct tetmesh *mesh = sides[m].mesh;
        measuring->values[m] = mesh->fields[sides[m].field].values + (component < 0 ? 0 : component);
        measuring->bounds[m] = sides[m].bound == TETLOD_NONE ? NULL : mesh->fields[sides[m].bound].values;
    }
    measuring->bin = bin_width(measuring);
}

enum tetlod_status difference_measure(struct difference *out, const struct difference_side sides[2], int component,
                                      unsigned threads, struct tetlod_error *error)
{
    struct measuring measuring = {.sides = sides, .out = out};
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
    parallel_for(threads, a->tet_count, CHUNK, compare_range, &measuring);
    add_up(&measuring, threads);
done:
    release(&measuring, threads);
    return status;
}

void difference_fini(struct difference *difference)
{
    free(difference->cells);
    *difference = (struct difference){0};
}
