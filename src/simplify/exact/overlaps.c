/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/exact/overlaps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* How much an interpolant's value changes at most over a unit of length, in units of what it varies in the
 * tetrahedron. */
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

enum tetlod_status overlaps_init(struct overlaps *overlaps, const struct tetmesh *mesh, const struct working *working,
                                 struct tetlod_error *error)
{
    size_t tets = mesh->tet_count;
    *overlaps = (struct overlaps){.mesh = mesh,
                                  .lists = array_new(tets, sizeof *overlaps->lists),
                                  .slopes = array_new(tets, sizeof *overlaps->slopes),
                                  .sentinels = array_new(tets, sizeof *overlaps->sentinels),
                                  .host = array_new(mesh->vertex_count, sizeof *overlaps->host)};
    if (!overlaps->lists || !overlaps->slopes || !overlaps->sentinels || !overlaps->host) {
        overlaps_fini(overlaps);
        return tetlodi_fail_nomem(error, "the overlaps", overlaps_bytes(mesh->vertex_count, mesh->tet_count));
    }
    enum tetlod_status status = working_origins(working, mesh, overlaps->lists, error);
    for (uint32_t t = 0; t < tets && status == TETLOD_OK; t++) {
        overlaps->slopes[t] = slope_of(mesh, t);
        overlaps->sentinels[t] = TETLOD_NONE;
        for (int c = 0; c < 4; c++)
            overlaps->host[mesh->corners[4 * (size_t)overlaps->lists[t] + (size_t)c]] = t;
    }
    if (status != TETLOD_OK)
        overlaps_fini(overlaps);
    return status;
}

/* The pool grows while tetrahedra go; both together take the most where it has about so many numbers for each that
 * there was. */
enum { POOLED = 4 };

uint64_t overlaps_bytes(uint32_t vertices, uint32_t tets)
{
    uint64_t per_tet = sizeof(uint32_t) + sizeof(float) + sizeof(uint32_t) + POOLED * sizeof(uint32_t);
    return tets * per_tet + vertices * (uint64_t)sizeof(uint32_t);
}

void overlaps_fini(struct overlaps *overlaps)
{
    free(overlaps->lists);
    free(overlaps->pool);
    free(overlaps->slopes);
    free(overlaps->sentinels);
    free(overlaps->watches);
    free(overlaps->host);
    *overlaps = (struct overlaps){0};
}

/* A watch of a tetrahedron that has fewer than it may have, before its others. False: no memory. */
static bool add_watch(struct overlaps *overlaps, uint32_t tet)
{
    if (overlaps->watch_count == TETLOD_NONE ||
        !ARRAY_RESERVE(overlaps->watches, overlaps->watch_capacity, overlaps->watch_count + 1))
        return false;
    overlaps->watches[overlaps->watch_count].next = overlaps->sentinels[tet];
    overlaps->sentinels[tet] = (uint32_t)overlaps->watch_count++;
    return true;
}

void overlaps_watch(struct overlaps *overlaps, const struct sentinel *sentinel)
{
    const struct watched *point = &sentinel->point;
    uint32_t chain[MAX_WATCHES], count = 0, same;
    if (sentinel->tet == TETLOD_NONE || point->ends[0] == TETLOD_NONE)
        return;
    for (uint32_t i = overlaps->sentinels[sentinel->tet]; i != TETLOD_NONE; i = overlaps->watches[i].next)
        chain[count++] = i;
    for (same = 0; same < count; same++) {
        const uint32_t *ends = overlaps->watches[chain[same]].point.ends;
        if (ends[0] == point->ends[0] && ends[1] == point->ends[1])
            break;
    }
    if (same == count && count < MAX_WATCHES) {
        if (add_watch(overlaps, sentinel->tet))
            overlaps->watches[overlaps->sentinels[sentinel->tet]].point = *point;
        return;
    }
    for (uint32_t last = same < count ? same : count - 1; last > 0;
         last--) // moved towards the end, over the one that goes
        overlaps->watches[chain[last]].point = overlaps->watches[chain[last - 1]].point;
    overlaps->watches[chain[0]].point = *point;
}

/* Moves the lists that are in use to the front of the pool. */
static void pool_compact(struct overlaps *overlaps)
{
    uint32_t *pool = overlaps->pool;
    size_t kept = 0;
    for (size_t at = 0, next; at < overlaps->pool_size; at = next) {
        size_t size = 2 + (size_t)pool[at + 1];
        next = at + size;
        if (overlaps->lists[pool[at]] != (OVERLAPS_POOLED | (at + 2)))
            continue;
        overlaps->lists[pool[at]] = OVERLAPS_POOLED | (uint32_t)(kept + 2);
        memmove(pool + kept, pool + at, size * sizeof *pool);
        kept += size;
    }
    overlaps->pool_size = kept;
}

/* Room for `needed` more in the pool, which is as large as what is in use and an eighth. */
static enum tetlod_status pool_room(struct overlaps *overlaps, size_t needed, struct tetlod_error *error)
{
    if (overlaps->pool_size + needed <= overlaps->pool_capacity)
        return TETLOD_OK;
    pool_compact(overlaps);
    size_t capacity = overlaps->pool_size + overlaps->pool_size / 8 + needed + 1024;
    if (overlaps->pool_size + needed >= OVERLAPS_POOLED)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "--certify exact keeps up to 2^31 pairs of overlapping tetrahedra, and this mesh has "
                            "more: use --certify fast");
    void *pool = array_resize(overlaps->pool, capacity, sizeof *overlaps->pool);
    if (!pool)
        return tetlodi_fail_nomem(error, "the overlaps", capacity * sizeof *overlaps->pool);
    overlaps->pool = pool;
    overlaps->pool_capacity = capacity;
    return TETLOD_OK;
}

void overlaps_renumber(struct overlaps *overlaps, const struct renumbering *numbers)
{
    pool_compact(overlaps);
    for (size_t at = 0; at < overlaps->pool_size; at += 2 + (size_t)overlaps->pool[at + 1])
        overlaps->pool[at] = numbers->tets[overlaps->pool[at]];
    for (uint32_t v = 0; v < overlaps->mesh->vertex_count; v++)
        if (overlaps->host[v] != TETLOD_NONE)
            overlaps->host[v] = numbers->tets[overlaps->host[v]];
    overlaps->lists = renumber_tets(numbers, overlaps->lists, sizeof *overlaps->lists);
    overlaps->sentinels = renumber_tets(numbers, overlaps->sentinels, sizeof *overlaps->sentinels);
}

enum tetlod_status overlaps_take(struct overlaps *overlaps, const struct star *star, const struct passed *passed,
                                 struct tetlod_error *error)
{
    const uint32_t *numbers = passed->numbers, *end = numbers + passed->count;
    for (uint32_t i = 0; i < star->tet_count; i++)
        overlaps->lists[star->tets[i]] = TETLOD_NONE;
    TETLOD_TRY(pool_room(overlaps, passed->list_count, error));
    for (const uint32_t *list = numbers; list < numbers + passed->list_count; list += 2 + (size_t)list[1])
        overlaps->lists[list[0]] = OVERLAPS_POOLED | (uint32_t)(overlaps->pool_size + (size_t)(list - numbers) + 2);
    memcpy(overlaps->pool + overlaps->pool_size, numbers, passed->list_count * sizeof *numbers);
    overlaps->pool_size += passed->list_count;
    for (numbers += passed->list_count; numbers < end; numbers += 2)
        overlaps->host[numbers[0]] = numbers[1];
    return TETLOD_OK;
}
