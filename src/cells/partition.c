/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh, and which of its vertices were at a seam before. Out: a tree of cuts and the tetrahedra of each of its
 * cells.
 *
 * A range of tetrahedra is cut in two until it is small enough. Candidates for a cut are middles and ends of the
 * bounding boxes of some tetrahedra whose middles lie in the window around the share that one side is to have. What a
 * candidate costs is counted on a sample of the range. Samples are taken at regular distances: nothing is left to
 * chance.
 */
#include "src/cells/partition.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* A range of fewer than MAX_FILLED times the tetrahedra asked for is a cell; a larger one is cut for cells of FILLED
 * times as many. */
static const double FILLED = 0.8, MAX_FILLED = 1.2;

/* Half the width of the window in which the cut may be, as a share of the range. */
static const double WINDOW = 0.15;

/* What a tetrahedron that was at a seam before counts more; and one that the cut crosses, against one that only touches
 * it: a cut between layers of a regular mesh touches as many on each side as one beside it crosses, and leaves half as
 * many vertices at the seam. */
enum { SEAM_WEIGHT = 3, CROSSING = 4 };

/* Tetrahedra that the window is found by, candidates on each axis, and tetrahedra that their cost is counted on. */
enum { RANKED = 4096, CANDIDATES = 24, COUNTED = 1 << 15 };

/* Tetrahedra that a thread parts at a time, and of those that are counted on. */
enum { CHUNK = 1 << 14, COUNTED_A_CHUNK = 1 << 11 };

struct cutter {
    const struct tetmesh *mesh;
    const uint8_t *was_seam;
    uint32_t cell_tets;
    struct partition *out;
    size_t tree_room, box_room, begin_room;
    double (*ranked)[2]; /* [3 * RANKED] middle and end of a box on each axis */
    struct pool *pool;
    uint32_t *spare;     /* [tet] */
    uint32_t *below;     /* [chunk of tetrahedra] */
    struct tetlod_error *error;
};

/* A part of out->tets that is still to be cut, and the box that the cuts before leave for it. */
struct range {
    uint32_t begin, end;
    struct tetlodi_box box;
    uint32_t cuts;   /* that it is behind */
    uint32_t parent; /* node of which it is the second part; TETLOD_NONE: it is the first part, or all */
};

void partition_fini(struct partition *partition)
{
    free(partition->tree);
    free(partition->boxes);
    free(partition->begins);
    free(partition->tets);
    free(partition->seams);
    *partition = (struct partition){0};
}

static enum tetlod_status no_memory(const struct cutter *cutter)
{
    return tetlodi_fail_nomem(cutter->error, "the partition", 8 * (uint64_t)cutter->mesh->tet_count);
}

static void extent_on(const struct tetmesh *mesh, uint32_t tet, int axis, double out[2])
{
    const uint32_t *corners = mesh->corners + 4 * (size_t)tet;
    out[0] = out[1] = mesh->positions[3 * (size_t)corners[0] + (size_t)axis];
    for (int c = 1; c < 4; c++) {
        double x = mesh->positions[3 * (size_t)corners[c] + (size_t)axis];
        out[0] = x < out[0] ? x : out[0];
        out[1] = x > out[1] ? x : out[1];
    }
}

/* As tetlodi_middle_of_box. */
static double middle_on(const struct tetmesh *mesh, uint32_t tet, int axis)
{
    double extent[2];
    extent_on(mesh, tet, axis, extent);
    return (extent[0] + extent[1]) / 2;
}

static bool was_at_seam(const struct cutter *cutter, uint32_t tet)
{
    const uint32_t *corners = cutter->mesh->corners + 4 * (size_t)tet;
    for (int c = 0; c < 4 && cutter->was_seam; c++)
        if (cutter->was_seam[corners[c]])
            return true;
    return false;
}

static int by_middle(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return x[0] != y[0] ? (x[0] > y[0]) - (x[0] < y[0]) : (x[1] > y[1]) - (x[1] < y[1]);
}

/* The candidates of an axis. What one costs is looked up by where it is among all, so a tetrahedron adds to a range of
 * them. */
struct costs {
    float listed[CANDIDATES];
    double at[CANDIDATES]; /* the same, ascending */
    uint32_t count;
    _Atomic uint64_t changes[CANDIDATES + 1]; /* what a candidate costs more than the one before, modulo 2^64 */
};

/* Where a range may be cut. */
struct choice {
    const struct cutter *cutter;
    const struct range *range;
    double share; /* of the range that the first part is to have */
    struct costs costs[3];
};

static int by_value(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* Lists the candidates on an axis. */
static void list_candidates(struct choice *choice, int axis)
{
    const struct cutter *cutter = choice->cutter;
    const struct range *range = choice->range;
    struct costs *costs = &choice->costs[axis];
    double(*ranked)[2] = cutter->ranked + axis * (size_t)RANKED;
    uint32_t n = range->end - range->begin, count = n < RANKED ? n : RANKED;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t tet = cutter->out->tets[range->begin + (uint32_t)((uint64_t)i * n / count)];
        double extent[2];
        extent_on(cutter->mesh, tet, axis, extent);
        ranked[i][0] = (extent[0] + extent[1]) / 2;
        ranked[i][1] = extent[1];
    }
    qsort(ranked, count, sizeof *ranked, by_middle);
    double first = choice->share - WINDOW, width = 2 * WINDOW;
    for (uint32_t k = 0; k < CANDIDATES; k++) {
        uint32_t i = (uint32_t)((first + width * (k / 2) / (CANDIDATES / 2 - 1)) * (count - 1));
        float at = (float)ranked[i][k % 2];
        if (!isfinite(at) || !((double)at > ranked[0][0]) || (double)at > ranked[count - 1][0])
            continue;
        costs->listed[costs->count] = at;
        costs->at[costs->count++] = (double)at;
    }
    qsort(costs->at, costs->count, sizeof *costs->at, by_value);
}

static void list_axes(void *context, unsigned worker, size_t begin, size_t end)
{
    (void)worker;
    for (size_t axis = begin; axis < end; axis++)
        list_candidates(context, (int)axis);
}

/* How many candidates are below x. */
static uint32_t count_below(const struct costs *costs, double x)
{
    uint32_t begin = 0;
    for (uint32_t left = costs->count; left;) {
        uint32_t half = left / 2;
        bool below = costs->at[begin + half] < x;
        begin += below ? half + 1 : 0;
        left = below ? left - half - 1 : half;
    }
    return begin;
}

/* Few candidates cut a tetrahedron: they are counted on from the first. */
static void add_costs(const struct costs *costs, uint64_t *changes, const double extent[2], uint64_t weight)
{
    if (!costs->count || extent[1] < costs->at[0] || extent[0] > costs->at[costs->count - 1])
        return;
    const uint32_t begin = count_below(costs, extent[0]);
    uint32_t inner = begin, inner_end, end;
    while (inner < costs->count && !(costs->at[inner] > extent[0]))
        inner++;
    for (inner_end = inner; inner_end < costs->count && costs->at[inner_end] < extent[1];)
        inner_end++;
    for (end = inner_end; end < costs->count && !(costs->at[end] > extent[1]);)
        end++;
    changes[begin] += weight;
    changes[end] -= weight;
    changes[inner] += (CROSSING - 1) * weight;
    changes[inner_end] -= (CROSSING - 1) * weight;
}

static uint32_t count_of_sample(const struct range *range)
{
    uint32_t n = range->end - range->begin;
    return n < COUNTED ? n : COUNTED;
}

/* What some tetrahedra of the sample add to the candidates of the three axes. */
static void count_costs(void *context, unsigned worker, size_t begin, size_t end)
{
    struct choice *choice = context;
    const struct cutter *cutter = choice->cutter;
    const struct range *range = choice->range;
    uint32_t n = range->end - range->begin, counted = count_of_sample(range);
    uint64_t changes[3][CANDIDATES + 1] = {0};
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        uint32_t tet = cutter->out->tets[range->begin + (uint32_t)(i * n / counted)];
        uint64_t weight = was_at_seam(cutter, tet) ? 1 + SEAM_WEIGHT : 1;
        for (int axis = 0; axis < 3; axis++) {
            double extent[2];
            extent_on(cutter->mesh, tet, axis, extent);
            add_costs(&choice->costs[axis], changes[axis], extent, weight);
        }
    }
    for (int axis = 0; axis < 3; axis++)
        for (uint32_t k = 0; k <= choice->costs[axis].count; k++)
            atomic_fetch_add_explicit(&choice->costs[axis].changes[k], changes[axis][k], memory_order_relaxed);
}

/* Where to cut a range: where it is crossed least; of several such places the first one listed. False: nowhere. */
static bool choose_cut(const struct cutter *cutter, const struct range *range, double share, struct tetlodi_cut *out)
{
    uint64_t least = UINT64_MAX;
    struct choice choice = {.cutter = cutter, .range = range, .share = share};
    pool_run(cutter->pool, 3, 1, list_axes, &choice);
    pool_run(cutter->pool, count_of_sample(range), COUNTED_A_CHUNK, count_costs, &choice);
    for (uint8_t axis = 0; axis < 3; axis++) {
        struct costs *costs = &choice.costs[axis];
        for (uint32_t k = 1; k < costs->count; k++)
            costs->changes[k] += costs->changes[k - 1]; // now costs
        for (uint32_t k = 0; k < costs->count; k++) {
            uint64_t cost = costs->changes[count_below(costs, (double)costs->listed[k])];
            if (cost < least) {
                least = cost;
                *out = (struct tetlodi_cut){.axis = axis, .at = costs->listed[k]};
            }
        }
    }
    return least != UINT64_MAX;
}

struct parting {
    const struct tetmesh *mesh;
    uint32_t *tets, *spare, count; /* of the range */
    const struct tetlodi_cut *cut;
    uint32_t *below;               /* [chunk] how many of its tetrahedra are below the cut */
};

/* In each chunk what is below the cut comes first, and the rest is in `spare`, at the chunk's begin. */
static void part_chunks(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct parting *parting = context;
    (void)worker;
    for (size_t chunk = begin; chunk < end; chunk++) {
        size_t first = chunk * CHUNK, last = first + CHUNK < parting->count ? first + CHUNK : parting->count;
        size_t kept = first, rest = first;
        for (size_t i = first; i < last; i++) {
            const uint32_t tet = parting->tets[i];
            if (middle_on(parting->mesh, tet, parting->cut->axis) < (double)parting->cut->at)
                parting->tets[kept++] = tet;
            else
                parting->spare[rest++] = tet;
        }
        parting->below[chunk] = (uint32_t)(kept - first);
    }
}

/* Puts what is below the cut first, in order; where the second part begins. */
static uint32_t part_range(const struct cutter *cutter, const struct range *range, const struct tetlodi_cut *cut)
{
    struct parting parting = {cutter->mesh, cutter->out->tets + range->begin, cutter->spare,
                              range->end - range->begin, cut, cutter->below};
    const size_t count = parting.count, chunks = (count + CHUNK - 1) / CHUNK;
    size_t kept = 0, to;
    pool_run(cutter->pool, chunks, 1, part_chunks, &parting);
    for (size_t chunk = 0; chunk < chunks; chunk++) {
        memmove(parting.tets + kept, parting.tets + chunk * CHUNK, parting.below[chunk] * sizeof *parting.tets);
        kept += parting.below[chunk];
    }
    to = kept;
    for (size_t chunk = 0; chunk < chunks; chunk++) {
        size_t size = chunk + 1 < chunks ? CHUNK : count - chunk * CHUNK, rest = size - parting.below[chunk];
        memcpy(parting.tets + to, parting.spare + chunk * CHUNK, rest * sizeof *parting.tets);
        to += rest;
    }
    return range->begin + (uint32_t)kept;
}

static bool reserve(struct cutter *cutter)
{
    struct partition *out = cutter->out;
    void *tree = out->tree, *boxes = out->boxes, *begins = out->begins;
    bool room = array_reserve(&tree, &cutter->tree_room, out->nodes + (size_t)1, sizeof *out->tree) &&
                array_reserve(&boxes, &cutter->box_room, out->cells + (size_t)1, sizeof *out->boxes) &&
                array_reserve(&begins, &cutter->begin_room, out->cells + (size_t)2, sizeof *out->begins);
    out->tree = tree;
    out->boxes = boxes;
    out->begins = begins;
    return room;
}

static void add_cell(struct partition *out, const struct range *range)
{
    out->tree[out->nodes++] = (struct tetlodi_cut){.axis = CUT_PAGE, .beyond = out->cells};
    out->boxes[out->cells] = range->box;
    out->begins[out->cells] = range->begin;
    out->begins[++out->cells] = range->end;
}

/* Cuts a range in two parts, or makes a cell of it. */
static bool cut_range(struct cutter *cutter, const struct range *range, struct range parts[2])
{
    struct partition *out = cutter->out;
    uint32_t n = range->end - range->begin, cells = (uint32_t)ceil(n / (FILLED * cutter->cell_tets));
    struct tetlodi_cut cut = {0};
    if (range->parent != TETLOD_NONE)
        out->tree[range->parent].beyond = out->nodes;
    if (range->cuts < MAX_CUTS && n > MAX_FILLED * cutter->cell_tets &&
        choose_cut(cutter, range, (double)(cells / 2) / cells, &cut)) {
        uint32_t middle = part_range(cutter, range, &cut);
        if (middle > range->begin && middle < range->end) {
            parts[0] = (struct range){range->begin, middle, range->box, range->cuts + 1, TETLOD_NONE};
            parts[1] = (struct range){middle, range->end, range->box, range->cuts + 1, out->nodes};
            parts[0].box.most[cut.axis] = parts[1].box.least[cut.axis] = (double)cut.at;
            out->tree[out->nodes++] = cut;
            return true;
        }
    }
    add_cell(out, range);
    return false;
}

/* Cuts until all are cells: the first part before the second one, so that nodes come in preorder. */
static enum tetlod_status cut_all(struct cutter *cutter)
{
    struct range stack[MAX_CUTS + 1];
    uint32_t depth = 1;
    stack[0] = (struct range){0,
                              cutter->mesh->tet_count,
                              {{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}},
                              0,
                              TETLOD_NONE};
    bool room = true;
    while (depth && room) {
        struct range parts[2], range = stack[--depth];
        room = reserve(cutter);
        if (room && cut_range(cutter, &range, parts)) {
            stack[depth++] = parts[1];
            stack[depth++] = parts[0];
        }
    }
    return room ? TETLOD_OK : no_memory(cutter);
}

struct seams {
    const struct tetmesh *mesh;
    struct partition *out;
    _Atomic uint32_t *cell_of; /* [vertex] a cell that has it, or TETLOD_NONE */
};

/* Of the cells that come to a vertex at least one finds another one there, in whatever order they come. */
static void mark_seams(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct seams *seams = context;
    const struct partition *out = seams->out;
    (void)worker;
    for (size_t cell = begin; cell < end; cell++)
        for (size_t i = 4 * (size_t)out->begins[cell]; i < 4 * (size_t)out->begins[cell + 1]; i++) {
            uint32_t v = seams->mesh->corners[4 * (size_t)out->tets[i / 4] + i % 4];
            if (atomic_load_explicit(&seams->cell_of[v], memory_order_relaxed) == cell)
                continue;
            uint32_t other = atomic_exchange_explicit(&seams->cell_of[v], (uint32_t)cell, memory_order_relaxed);
            if (other != TETLOD_NONE && other != cell)
                atomic_store_explicit((_Atomic uint8_t *)&out->seams[v], 1, memory_order_relaxed);
        }
}

/* Vertices with tetrahedra in several cells. */
static enum tetlod_status find_seams(const struct cutter *cutter)
{
    const struct tetmesh *mesh = cutter->mesh;
    struct partition *out = cutter->out;
    struct seams seams = {mesh, out, array_new(mesh->vertex_count, sizeof *seams.cell_of)};
    out->seams = array_zero(mesh->vertex_count, 1);
    if (!seams.cell_of || !out->seams) {
        free(seams.cell_of);
        return no_memory(cutter);
    }
    memset(seams.cell_of, 0xff, mesh->vertex_count * sizeof *seams.cell_of);
    pool_run(cutter->pool, out->cells, 1, mark_seams, &seams);
    free(seams.cell_of);
    return TETLOD_OK;
}

enum tetlod_status partition_make(struct partition *out, const struct tetmesh *mesh, uint32_t cell_tets,
                                  const uint8_t *was_seam, struct pool *pool, struct tetlod_error *error)
{
    struct cutter cutter = {.mesh = mesh,
                            .was_seam = was_seam,
                            .cell_tets = cell_tets,
                            .out = out,
                            .ranked = array_new(3 * RANKED, sizeof *cutter.ranked),
                            .pool = pool,
                            .spare = array_new(mesh->tet_count, sizeof *cutter.spare),
                            .below = array_new(mesh->tet_count / CHUNK + (size_t)1, sizeof *cutter.below),
                            .error = error};
    enum tetlod_status status = TETLOD_OK;
    *out = (struct partition){.tets = array_new(mesh->tet_count, sizeof *out->tets)};
    if (!out->tets || !cutter.ranked || !cutter.spare || !cutter.below)
        TETLOD_TRY_DONE(no_memory(&cutter));
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        out->tets[t] = t;
    TETLOD_TRY_DONE(cut_all(&cutter));
    status = find_seams(&cutter);
done:
    free(cutter.ranked);
    free(cutter.spare);
    free(cutter.below);
    if (status != TETLOD_OK)
        partition_fini(out);
    return status;
}
