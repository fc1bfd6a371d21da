/* SPDX-License-Identifier: BSD-3-Clause */
/* The star of a vertex laid out for its split: link vertices, link edges, and which tetrahedra share them. Not
 * installed. */
#ifndef TETLOD_STAR_VIEW_H
#define TETLOD_STAR_VIEW_H

#include "format/record.h"

/* 0 if out of memory. */
int tetlodi_star_lay_out(struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t vertex);
void tetlodi_star_fini(struct tetlodi_star_view *view, struct tetlodi_memory *memory);

/* The ends of a link edge, by number in the link. */
void tetlodi_star_ends(const struct tetlodi_star_view *view, uint32_t e, uint32_t ends[2]);

/* The corners of the tetrahedron that comes back at edge e between the split vertex and child (SPEC 7.4). */
void tetlodi_star_between(const struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t e,
                          uint32_t child, uint32_t corners[4]);

/* Their positions, with the vertex's and the child's. */
void tetlodi_star_between_points(const struct tetlodi_star_view *view, uint32_t e, const double *vertex,
                                 const double *child,
                                 const double *points[4]);

/* Two tetrahedra of a star at a time: each lane does what SPEC says of one. */
typedef double pair2 __attribute__((vector_size(16)));
typedef int64_t mask2 __attribute__((vector_size(16)));

struct corner2 {
    pair2 x, y, z;
};

/* Corners `k` but the vertex of tetrahedra i and i + 1 of the star, its last one twice if it is odd. */
TETLODI_INLINE struct corner2 corner2(const struct tetlodi_star_view *star, uint32_t i, int k)
{
    const double *p = star->positions[star->others[i][k]], *q = star->positions[star->others[i + (i + 1 < star->size)][k]];
    return (struct corner2){{p[0], q[0]}, {p[1], q[1]}, {p[2], q[2]}};
}

#endif
