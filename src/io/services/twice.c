/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A cell of several pieces is a copy, of a layer around a piece, that is not marked. All of its points are then points
 * of several pieces that have become one. Such cells are listed by their least point; those of one point are sorted by
 * a hash of all of theirs, in any order, and those of one hash are compared.
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/assemble.h"
#include "src/util/array.h"

/* Cells of more points are left out. */
enum { MAX_POINTS = 27 };

struct candidate {
    uint64_t hash, cell;
};

struct search {
    const struct block *block;
    const uint8_t *sources; /* [point] of how many it was made: 0, 1, or 2 for more */
    uint32_t points[MAX_POINTS], count;
    bool all_joined;
};

static void note_point(void *opaque, uint32_t *point)
{
    struct search *search = opaque;
    if (*point >= search->block->mesh.vertex_count || search->sources[*point] < 2 || search->count == MAX_POINTS)
        search->all_joined = false;
    else
        search->points[search->count++] = *point;
}

static int by_number(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* Lists a cell's points, ascending. False: it is of one piece alone, or hidden. */
static bool list_points(struct search *search, uint64_t cell)
{
    search->count = 0;
    search->all_joined = !search->block->hidden || !search->block->hidden[cell];
    if (search->all_joined && !cells_visit_points(&search->block->cells, cell, note_point, search))
        search->all_joined = false;
    if (search->all_joined)
        qsort(search->points, search->count, sizeof *search->points, by_number);
    return search->all_joined && search->count;
}

static uint64_t hash_points(const struct search *search)
{
    uint64_t hash = search->count;
    for (uint32_t i = 0; i < search->count; i++) {
        hash = (hash ^ search->points[i]) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 29;
    }
    return hash;
}

static int by_hash(const void *a, const void *b)
{
    const struct candidate *x = a, *y = b;
    return x->hash != y->hash ? (x->hash > y->hash) - (x->hash < y->hash) : (x->cell > y->cell) - (x->cell < y->cell);
}

static bool same_points(struct search *search, uint64_t a, uint64_t b)
{
    uint32_t points[MAX_POINTS];
    list_points(search, a);
    const uint32_t count = search->count;
    memcpy(points, search->points, count * sizeof *points);
    list_points(search, b);
    return count == search->count && memcmp(points, search->points, count * sizeof *points) == 0;
}

static enum tetlod_status fail(struct search *search, uint64_t cell, const uint32_t *target, uint64_t twice,
                               struct tetlod_error *error)
{
    uint32_t v = 0;
    list_points(search, cell);
    while (target[v] != search->points[0])
        v++;
    const double *p = search->block->mesh.positions + 3 * (size_t)v;
    return tetlodi_fail(error, TETLOD_ERR_MESH,
                        "%llu cells are in several pieces, one of them at (%.9g, %.9g, %.9g): they are copies that are "
                        "not marked. Write the pieces without ghost cells, mark these by vtkGhostType, or drop them by "
                        "--drop-degenerate; of blocks that repeat others, read one (--block)",
                        (unsigned long long)twice, p[0], p[1], p[2]);
}

/* Cells by their least points: chains of numbers. */
struct chains {
    uint32_t *first, *next; /* [point], [cell]; TETLOD_NONE ends one */
    struct candidate *list; /* of one point */
    size_t capacity;
    uint64_t twice, cell; /* how many are there twice, and one of them */
};

static void chain_cells(struct search *search, struct chains *chains)
{
    memset(chains->first, 0xff, search->block->mesh.vertex_count * sizeof *chains->first);
    for (uint64_t c = 0; c < search->block->cells.count; c++)
        if (list_points(search, c)) {
            chains->next[c] = chains->first[search->points[0]];
            chains->first[search->points[0]] = (uint32_t)c;
        }
}

/* The cells of one chain. False: no memory. */
static bool compare_chain(struct search *search, struct chains *chains, uint32_t first)
{
    size_t count = 0;
    for (uint32_t c = first; c != TETLOD_NONE; c = chains->next[c]) {
        if (!ARRAY_RESERVE(chains->list, chains->capacity, count + 1))
            return false;
        list_points(search, c);
        chains->list[count++] = (struct candidate){hash_points(search), c};
    }
    if (count)
        qsort(chains->list, count, sizeof *chains->list, by_hash);
    for (size_t i = 1; i < count; i++) {
        const struct candidate *at = &chains->list[i];
        if (at->hash == at[-1].hash && same_points(search, at[-1].cell, at->cell)) {
            chains->cell = at->cell;
            chains->twice++;
        }
    }
    return true;
}

enum tetlod_status block_check_twice(const struct block *block, const uint32_t *target, struct tetlod_error *error)
{
    const uint32_t points = block->mesh.vertex_count;
    if (block->cells.count >= TETLOD_NONE)
        return TETLOD_OK; // there are too many in any case
    uint8_t *sources = array_zero(points, 1);
    struct search search = {.block = block, .sources = sources};
    struct chains chains = {.first = array_new(points, sizeof *chains.first),
                            .next = array_new((size_t)block->cells.count, sizeof *chains.next)};
    bool room = sources && chains.first && chains.next;
    for (uint32_t v = 0; v < points && room; v++)
        sources[target[v]] += sources[target[v]] < 2;
    if (room)
        chain_cells(&search, &chains);
    for (uint32_t v = 0; v < points && room; v++)
        room = compare_chain(&search, &chains, chains.first[v]);
    enum tetlod_status status = TETLOD_OK;
    if (!room)
        status = tetlodi_fail_nomem(error, "the pieces", 5 * (uint64_t)points + 4 * block->cells.count);
    else if (chains.twice)
        status = fail(&search, chains.cell, target, chains.twice, error);
    free(sources);
    free(chains.first);
    free(chains.next);
    free(chains.list);
    return status;
}
