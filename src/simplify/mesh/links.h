/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The link condition of an edge ab: Lk(a) and Lk(b) meet in Lk(ab) only, with the boundary coned to one more vertex
 * (Dey, Edelsbrunner, Guha and Nekhayev 1999). Then contracting it leaves a complex of the same topology.
 */
#ifndef TETLOD_LINKS_H
#define TETLOD_LINKS_H

#include "src/simplify/mesh/star_data.h"
#include "src/simplify/mesh/star.h"
#include "src/simplify/mesh/table.h"

struct links {
    uint8_t *marks;        /* [neighbour] */
    uint32_t (*beside)[2]; /* [neighbour] of the ring: the vertices before and behind it */
    size_t mark_room, beside_room;
    bool listed;           /* the next three are of this edge */
    uint32_t pair_count;   /* edges of Lk(a) between vertices of the ring, but not of it: in `pairs` */
    struct table pairs;
    bool closed;           /* Lk(a) has a triangle all of whose edges are the ring's */
    /* of links_hold_star: the star's tetrahedra in numbers of their own, and the boundary's cone */
    uint32_t (*copy)[4];
    uint32_t copy_count, copy_vertices;
    struct table numbers;  /* [slot] */
    size_t copy_room;
};

void links_fini(struct links *links);

/* Does it hold for the edge from the star's vertex to a neighbour? Time linear in both stars. *out_room: false if
 * memory ran out. */
bool links_hold(struct links *links, const struct star_data *data, const struct working *working, uint32_t neighbour,
                bool *out_room);

/* Does it hold for a gathered simplex of any size, taken as a sequence of edges? On a copy of the star, whose size is
 * the time. */
bool links_hold_star(struct links *links, const struct star *star, const struct working *working, bool *out_room);

#endif
