/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The neighbourhood of a vertex: its star in numbers of its own, as arrays that four tetrahedra at a time are computed
 * from.
 *
 * Every tetrahedron of the star has the vertex's own values at the vertex. So its interpolant at a point p = v + t (b -
 * v) of the edge to a neighbour b is (1 - t) times the vertex's value plus t times what it says at b: one look at the
 * star (the planes) evaluates all of the vertex's edges, and any point of them (PROOF.md, 9).
 */
#ifndef TETLOD_STAR_DATA_H
#define TETLOD_STAR_DATA_H

#include "src/simplify/mesh/working.h"
#include "src/util/wide.h"

/* Planes of a star. The volume of a tetrahedron (six times it) with the vertex moved by r is volume + slope . r; it
 * counts as turned over where that is at most `least`. U and L of component c rise by gradient . r. Those of four
 * tetrahedra stand together. */
enum { PLANE_SLOPE = 0, PLANE_VOLUME = 3, PLANE_LEAST = 4, PLANE_GRADIENTS = 5 };

static inline size_t plane_count(uint32_t components)
{
    return PLANE_GRADIENTS + 6 * (size_t)components;
}

/* So many tetrahedra are looked at between tests of whether to go on; the last of a star's repeat the first. */
enum { BLOCK = 2 * WIDE };

struct star_data {
    uint32_t vertex, tet_count, count; /* count: of the neighbours */
    uint32_t *tets;       /* [tet] */
    /* [tet] the others, in numbers of neighbours, so that the tetrahedron (vertex, 0, 1, 2) is positive */
    uint32_t *corners[3];
    uint32_t *slots;      /* [neighbour] */
    uint32_t *shared;     /* [neighbour] tetrahedra that have it */
    uint8_t *along;       /* [neighbour] the edge to it is on the boundary */
    double *rows;         /* [neighbour * stride] less the vertex's own */
    double *planes;       /* those of four tetrahedra together */
    uint32_t *doubtful;   /* [tet] scratch: some of their numbers */
    /* [neighbour * 2 * components] what the star says there, at most of U and at least of L, less the vertex's own */
    double *reach;
    size_t room; /* tetrahedra that fit, a multiple of BLOCK */
    uint32_t *numbers; /* [slot] which neighbour it is, if `slots` says so too: nothing has to be cleared */
};

/* Gathers the star of a slot: all but rows and what is computed of them. False: no memory. */
bool star_data_gather(struct star_data *data, const struct working *working, uint32_t slot);
void star_data_fini(struct star_data *data);

/* The number of a neighbour, or `none`. Which slots are neighbours is hard to foresee: there are no branches. */
static inline uint32_t star_data_number_or(const struct star_data *data, uint32_t slot, uint32_t none)
{
    uint32_t number = data->numbers[slot];
    number = number < data->count ? number : 0;
    return data->slots[number] == slot ? number : none;
}

#endif
