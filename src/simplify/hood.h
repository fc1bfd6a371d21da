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

/* Which neighbour a slot is: a hash table that forgets all at once. */
struct numbering {
    uint32_t *slots, *numbers; /* [place] TETLOD_NONE: free */
    uint32_t mask;             /* places less one, a power of two */
    size_t room;
};

struct hood {
    uint32_t vertex, tet_count, count; /* count: of the neighbours */
    uint32_t *tets;       /* [tet] */
    uint32_t *corners[3]; /* [tet] the others, in numbers of neighbours, so that the tetrahedron (vertex, 0, 1, 2) is positive */
    uint32_t *slots;      /* [neighbour] */
    uint32_t *shared;     /* [neighbour] tetrahedra that have it */
    uint8_t *along;       /* [neighbour] the edge to it is on the boundary */
    double *rows;         /* [neighbour * stride] less the vertex's own */
    double *planes;       /* see kernels.h */
    uint32_t *doubtful;   /* [tet] scratch: some of their numbers */
    double *reach;        /* [neighbour * 2 * components] what the star says there, at most of U and at least of L, less the vertex's own */
    size_t room; /* tetrahedra that fit, a multiple of BLOCK (kernels.h) */
    struct numbering numbering;
};

/* Gathers the star of a slot: all but rows and what is computed of them. False: no memory. */
bool hood_gather(struct hood *hood, const struct working *working, uint32_t slot);
void hood_fini(struct hood *hood);

/* Where the slot is in the table, or else the free place that it would take. */
static inline uint32_t numbering_place(const struct numbering *numbering, uint32_t slot)
{
    uint32_t at = slot * UINT32_C(0x9e3779b1) >> 15 & numbering->mask;
    while (numbering->slots[at] != slot && numbering->slots[at] != TETLOD_NONE)
        at = (at + 1) & numbering->mask;
    return at;
}

/* The number of a neighbour, or TETLOD_NONE. */
static inline uint32_t hood_number(const struct hood *hood, uint32_t slot)
{
    uint32_t at = numbering_place(&hood->numbering, slot);
    return hood->numbering.slots[at] == TETLOD_NONE ? TETLOD_NONE : hood->numbering.numbers[at];
}

#endif
