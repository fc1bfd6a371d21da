/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The neighbourhood of a vertex: its star in numbers of its own, as arrays that four tetrahedra at a time are computed from.
 *
 * Every tetrahedron of the star has the vertex's own values at the vertex. So its interpolant at a point p = v + t (b - v) of the
 * edge to a neighbour b is (1 - t) times the vertex's value plus t times what it says at b: one look at the star (the planes)
 * evaluates all of the vertex's edges, and any point of them (PROOF.md, 9).
 */
#ifndef TETLOD_HOOD_H
#define TETLOD_HOOD_H

#include "src/simplify/working.h"

/* A hash table of small numbers by key, that forgets all at once. */
struct table {
    uint64_t *keys; /* TABLE_FREE where there is none */
    uint32_t *values;
    size_t size, capacity; /* powers of two */
};

/* Forgets everything; room for `most` keys. False: no memory. */
bool table_clear(struct table *table, size_t most);
void table_fini(struct table *table);

/* The value of the key, which is `value` if it was not there. */
uint32_t *table_at(struct table *table, uint64_t key, uint32_t value);

/* NULL if it is not there. */
const uint32_t *table_find(const struct table *table, uint64_t key);

struct hood {
    uint32_t vertex, tet_count, count; /* count: of the neighbours */
    uint32_t *tets;       /* [tet] */
    uint32_t *corners[3]; /* [tet] the others, in numbers of neighbours, so that the tetrahedron (vertex, 0, 1, 2) is positive */
    uint32_t *slots;      /* [neighbour] */
    uint32_t *shared;     /* [neighbour] tetrahedra that have it */
    uint8_t *along;       /* [neighbour] the edge to it is on the boundary */
    double *rows;         /* [neighbour * stride] less the vertex's own */
    double *planes;       /* [plane * room] by tetrahedron: see kernels.h */
    double *reach;        /* [neighbour * 2 * components] what the star says there, at most of U and at least of L, less the vertex's own */
    size_t room; /* tetrahedra that fit, a multiple of four */
    struct table numbers;
};

/* Gathers the star of a slot: all but rows and what is computed of them. False: no memory. */
bool hood_gather(struct hood *hood, const struct working *working, uint32_t slot);
void hood_fini(struct hood *hood);

/* The number of a neighbour, or TETLOD_NONE. */
static inline uint32_t hood_number(const struct hood *hood, uint32_t slot)
{
    const uint32_t *found = table_find(&hood->numbers, slot);
    return found ? *found : TETLOD_NONE;
}

static inline double *hood_plane(const struct hood *hood, uint32_t plane)
{
    return hood->planes + plane * hood->room;
}

#endif
