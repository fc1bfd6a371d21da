/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A face is known by the places of three of its corners. Where a piece has two faces at the same place, other points of
 * it each, they are the sides of a crack: these join nothing. Faces are looked for among all threes of corners of a
 * cell, as threes within it meet no other piece's cell.
 */
#include "src/io/services/weld_pieces.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/union_find.h"

/* Cells of more points are left out: they are of high order, whose corners come first. */
enum { MAX_POINTS = 27 };

struct corners {
    uint32_t places[3], points[3], origin; /* places: ascending */
};

struct untie {
    const uint32_t *origins;
    uint32_t *places, *target; /* [vertex] what came in; what comes out */
    uint8_t *tied;             /* [place] several points of a piece are there */
    struct corners *list;
    size_t count, capacity;
    uint32_t points[MAX_POINTS]; /* of a cell */
    unsigned point_count;
    bool failed;
};

/* Are there such places? Points of a piece follow one another. */
static enum tetlod_status find_ties(struct untie *u, uint32_t count, bool *out_any, struct tetlod_error *error)
{
    uint32_t *last = array_new(count, sizeof *last);
    if (!last)
        return tetlodi_fail_nomem(error, "welding", (uint64_t)count * 4);
    memset(last, 0xff, count * sizeof *last);
    for (uint32_t v = 0; v < count; v++) {
        bool tied = last[u->places[v]] == u->origins[v] && !(u->origins[v] & 1);
        u->tied[u->places[v]] |= tied;
        *out_any |= tied;
        last[u->places[v]] = u->origins[v];
    }
    free(last);
    return TETLOD_OK;
}

/* ---- faces */

static void add_three(struct untie *u, uint32_t a, uint32_t b, uint32_t c)
{
    struct corners corners = {.points = {a, b, c}, .origin = u->origins[a]};
    for (int i = 0; i < 3; i++) // by place
        for (int j = 2; j > i; j--)
            if (u->places[corners.points[j]] < u->places[corners.points[j - 1]]) {
                uint32_t swap = corners.points[j];
                corners.points[j] = corners.points[j - 1];
                corners.points[j - 1] = swap;
            }
    bool any = false;
    for (int i = 0; i < 3; i++) {
        corners.places[i] = u->places[corners.points[i]];
        any |= u->tied[corners.places[i]] != 0;
    }
    if (!any || corners.places[0] == corners.places[1] || corners.places[1] == corners.places[2])
        return;
    if (ARRAY_RESERVE(u->list, u->capacity, u->count + 1))
        u->list[u->count++] = corners;
    else
        u->failed = true;
}

static void note_point(void *opaque, uint32_t *point)
{
    struct untie *u = opaque;
    bool known = *point == TETLOD_NONE;
    for (unsigned i = 0; i < u->point_count && !known; i++)
        known = u->points[i] == *point;
    if (!known && u->point_count < MAX_POINTS)
        u->points[u->point_count++] = *point;
}

static void add_cell(struct untie *u, const struct cells *cells, uint64_t cell)
{
    bool any = false;
    u->point_count = 0;
    if (!cells_visit_points(cells, cell, note_point, u))
        return; // it is refused where cells are split
    for (unsigned i = 0; i < u->point_count; i++)
        any |= u->tied[u->places[u->points[i]]] != 0;
    for (unsigned a = 0; a < u->point_count && any; a++)
        for (unsigned b = a + 1; b < u->point_count; b++)
            for (unsigned c = b + 1; c < u->point_count; c++)
                add_three(u, u->points[a], u->points[b], u->points[c]);
}

/* By places; then by piece and points. */
static int by_places(const void *a, const void *b)
{
    const struct corners *x = a, *y = b;
    int order = memcmp(x->places, y->places, sizeof x->places);
    order = order ? order : (x->origin > y->origin) - (x->origin < y->origin);
    return order ? order : memcmp(x->points, y->points, sizeof x->points);
}

/* ---- what is joined */

/* Faces at one place, unless a piece has two of them. */
static void join_faces(struct untie *u, size_t begin, size_t end)
{
    const struct corners *list = u->list;
    for (size_t i = begin + 1; i < end; i++)
        if (list[i].origin == list[i - 1].origin &&
            memcmp(list[i].points, list[i - 1].points, sizeof list->points) != 0)
            return;
    for (size_t i = begin + 1; i < end; i++)
        for (int c = 0; c < 3; c++)
            join_sets(u->target, list[begin].points[c], list[i].points[c]);
}

static void join_all(struct untie *u, uint32_t count)
{
    for (uint32_t v = 0; v < count; v++)
        u->target[v] = u->tied[u->places[v]] && !(u->origins[v] & 1) ? v : u->places[v];
    qsort(u->list, u->count, sizeof *u->list, by_places);
    for (size_t begin = 0, end; begin < u->count; begin = end) {
        for (end = begin + 1; end < u->count && memcmp(u->list[end].places, u->list[begin].places,
                                                       sizeof u->list->places) == 0;)
            end++;
        join_faces(u, begin, end);
    }
    for (uint32_t v = 0; v < count; v++)
        u->target[v] = find_root(u->target, v);
}

enum tetlod_status weld_untie(const struct block *block, const uint32_t *origins, uint32_t *io_target,
                              struct tetlod_error *error)
{
    const uint32_t count = block->mesh.vertex_count;
    struct untie u = {.origins = origins, .target = io_target, .places = array_new(count, sizeof *u.places),
                      .tied = array_zero(count, 1)};
    bool any = false;
    enum tetlod_status status =
        u.places && u.tied ? TETLOD_OK : tetlodi_fail_nomem(error, "welding", (uint64_t)count * 5);
    if (status == TETLOD_OK) {
        memcpy(u.places, io_target, count * sizeof *u.places);
        status = find_ties(&u, count, &any, error);
    }
    for (uint64_t c = 0; c < block->cells.count && any && !u.failed; c++)
        add_cell(&u, &block->cells, c);
    if (u.failed)
        status = tetlodi_fail_nomem(error, "welding", u.count * sizeof *u.list);
    if (status == TETLOD_OK && any)
        join_all(&u, count);
    free(u.places);
    free(u.tied);
    free(u.list);
    return status;
}
