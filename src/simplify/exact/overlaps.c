/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/exact/overlaps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* How much an interpolant's value changes at most over a unit of length, in units of what it varies in the tetrahedron. */
static float slope_of(const struct tetmesh *mesh, uint32_t tet)
{
    const double *p[4];
    for (int c = 0; c < 4; c++)
        p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + (size_t)c];
    if (tet_orientation(p[0], p[1], p[2], p[3]) == 0)
        return 0;
    double slope = tet_size_squared(p[0], p[1], p[2], p[3]) / fabs(tet_volume6(p[0], p[1], p[2], p[3]));
    return nextafterf((float)slope, INFINITY);
}

enum tetlod_status overlaps_init(struct overlaps *overlaps, const struct tetmesh *mesh, struct tetlod_error *error)
{
    size_t tets = mesh->tet_count;
    *overlaps = (struct overlaps){.mesh = mesh,
                                  .begin = array_new(tets, sizeof *overlaps->begin),
                                  .pool = array_new(3 * tets, sizeof *overlaps->pool),
                                  .pool_size = 3 * tets,
                                  .pool_capacity = 3 * tets,
                                  .slopes = array_new(tets, sizeof *overlaps->slopes),
                                  .sentinels = array_new(tets, SENTINELS * sizeof *overlaps->sentinels),
                                  .host = array_new(mesh->vertex_count, sizeof *overlaps->host)};
    if (!overlaps->begin || !overlaps->pool || !overlaps->slopes || !overlaps->sentinels || !overlaps->host) {
        overlaps_fini(overlaps);
        return tetlodi_fail_nomem(error, "the overlaps", overlaps_bytes(mesh->vertex_count, mesh->tet_count));
    }
    for (uint32_t t = 0; t < tets; t++) {
        overlaps->begin[t] = 3 * (size_t)t + 2;
        memcpy(overlaps->pool + 3 * (size_t)t, (uint32_t[]){t, 1, t}, 3 * sizeof *overlaps->pool);
        overlaps->slopes[t] = slope_of(mesh, t);
        for (int i = 0; i < SENTINELS; i++)
            overlaps->sentinels[SENTINELS * (size_t)t + (size_t)i].ends[0] = TETLOD_NONE;
        for (int c = 0; c < 4; c++)
            overlaps->host[mesh->corners[4 * (size_t)t + (size_t)c]] = t;
    }
    return TETLOD_OK;
}

/* The pool grows while tetrahedra go; both together take the most where it has about so many numbers for each that there was. */
enum { POOLED = 4 };

uint64_t overlaps_bytes(uint32_t vertices, uint32_t tets)
{
    uint64_t per_tet = sizeof(size_t) + sizeof(float) + SENTINELS * sizeof(struct watched) + POOLED * sizeof(uint32_t);
    return tets * per_tet + vertices * (uint64_t)sizeof(uint32_t);
}

void overlaps_fini(struct overlaps *overlaps)
{
    free(overlaps->begin);
    free(overlaps->pool);
    free(overlaps->slopes);
    free(overlaps->sentinels);
    free(overlaps->host);
    *overlaps = (struct overlaps){0};
}

void overlaps_watch(struct overlaps *overlaps, const struct sentinel *sentinel)
{
    const struct watched *point = &sentinel->point;
    if (sentinel->tet == TETLOD_NONE || point->ends[0] == TETLOD_NONE)
        return;
    struct watched *own = overlaps->sentinels + SENTINELS * (size_t)sentinel->tet;
    int last = 0;
    while (last < SENTINELS - 1 && (own[last].ends[0] != point->ends[0] || own[last].ends[1] != point->ends[1]))
        last++;
    memmove(own + 1, own, (size_t)last * sizeof *own);
    own[0] = *point;
}

void handover_fini(struct handover *handover)
{
    free(handover->numbers);
    *handover = (struct handover){0};
}

/* Moves the lists that are in use to the front of the pool. */
static void pool_compact(struct overlaps *overlaps)
{
    uint32_t *pool = overlaps->pool;
    size_t kept = 0;
    for (size_t at = 0, next; at < overlaps->pool_size; at = next) {
        size_t size = 2 + (size_t)pool[at + 1];
        next = at + size;
        if (overlaps->begin[pool[at]] != at + 2)
            continue;
        overlaps->begin[pool[at]] = kept + 2;
        memmove(pool + kept, pool + at, size * sizeof *pool);
        kept += size;
    }
    overlaps->pool_size = kept;
}

void overlaps_renumber(struct overlaps *overlaps, const struct renumbering *tets)
{
    pool_compact(overlaps);
    for (size_t at = 0; at < overlaps->pool_size; at += 2 + (size_t)overlaps->pool[at + 1])
        overlaps->pool[at] = tets->numbers[overlaps->pool[at]];
    for (uint32_t v = 0; v < overlaps->mesh->vertex_count; v++)
        overlaps->host[v] = renumbered(tets, overlaps->host[v]);
    renumber_array(&overlaps->begin, sizeof *overlaps->begin, tets);
    renumber_array(&overlaps->sentinels, SENTINELS * sizeof *overlaps->sentinels, tets);
    overlaps->pool_capacity = overlaps->pool_size + overlaps->pool_size / 16;
    overlaps->pool = array_shrink(overlaps->pool, overlaps->pool_capacity, sizeof *overlaps->pool);
}

/* Room for `needed` more in the pool, which is as large as what is in use and an eighth. */
static bool pool_room(struct overlaps *overlaps, size_t needed)
{
    if (overlaps->pool_size + needed <= overlaps->pool_capacity)
        return true;
    pool_compact(overlaps);
    size_t capacity = overlaps->pool_size + overlaps->pool_size / 8 + needed + 1024;
    void *pool = array_resize(overlaps->pool, capacity, sizeof *overlaps->pool);
    if (!pool)
        return false;
    overlaps->pool = pool;
    overlaps->pool_capacity = capacity;
    return true;
}

enum tetlod_status overlaps_take(struct overlaps *overlaps, const struct star *star, const struct handover *handover,
                                 struct tetlod_error *error)
{
    const uint32_t *numbers = handover->numbers, *end = numbers + handover->count;
    for (uint32_t i = 0; i < star->tet_count; i++)
        overlaps->begin[star->tets[i]] = 0;
    if (!pool_room(overlaps, handover->list_count))
        return tetlodi_fail_nomem(error, "the overlaps", handover->list_count * sizeof *overlaps->pool);
    for (const uint32_t *list = numbers; list < numbers + handover->list_count; list += 2 + (size_t)list[1])
        overlaps->begin[list[0]] = overlaps->pool_size + (size_t)(list - numbers) + 2;
    memcpy(overlaps->pool + overlaps->pool_size, numbers, handover->list_count * sizeof *numbers);
    overlaps->pool_size += handover->list_count;
    for (numbers += handover->list_count; numbers < end; numbers += 2)
        overlaps->host[numbers[0]] = numbers[1];
    return TETLOD_OK;
}
