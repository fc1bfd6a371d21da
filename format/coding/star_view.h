/* SPDX-License-Identifier: BSD-3-Clause */
/* The star of a vertex laid out for its split: link vertices, link edges, and which tetrahedra share them. Not
 * installed. */
#ifndef TETLOD_STAR_VIEW_H
#define TETLOD_STAR_VIEW_H

#include "format/coding/replay.h"
#include "format/common/coder.h"

/* An edge of the link of the vertex that splits; it and the vertex are a face. */
struct tetlodi_link_edge {
    /* of the star that have it: 3 * the place in the star + which of the other corners is not on it */
    uint32_t first, last;
};
/* the labels of an edge's tetrahedra; sums of three do not mix */
enum { LABEL_STAYS = 1, LABEL_GOES = 4, LABELS_DIFFER = 5 };
/* a tetrahedron comes back at an edge; not as the edge implies */
enum { NOT_MADE = 0, MADE = 1, MADE_FLIPPED = 2 };

/* The star of a vertex laid out to be split. */
struct tetlodi_star_view {
    uint32_t vertex, size, link_count, edge_count, extra_count;
    /* the star in the replay's pool, until it is split: 4 * tetrahedron + which the vertex is; that alone */
    const uint32_t *corners;
    uint8_t *which;
    int64_t own[3];      /* codes of the vertex's position before the record */
    double ends[2][3];   /* positions of the vertex and of the child that parts from it, once they are known */
    uint32_t (*others)[3], (*edges)[3]; /* others: the corners but the vertex, by number in the link */
    uint8_t *labels, *contexts;         /* label 1: goes with the child */
    uint32_t *link;                     /* vertices */
    double (*positions)[4];             /* theirs; the fourth is unused */
    int64_t *codes, *axis_codes[3];     /* theirs, axis by axis */
    struct tetlodi_link_edge *edge;
    uint8_t *seen, *made;    /* of edges */
    uint32_t (*extras)[2];   /* vertices */
    size_t which_capacity, others_capacity, edges_capacity, labels_capacity, contexts_capacity, link_capacity,
        positions_capacity, codes_capacity, edge_capacity, seen_capacity, made_capacity, extras_capacity;
};

/* By which a link is found of the star that was laid out last. */
struct tetlodi_star_marks {
    uint32_t *mark, *table;    /* numbers in the link of vertices, from first_mark on; of edges */
    uint32_t first_mark, mask; /* mask: of a hash table of edges; 0: it has all pairs */
    size_t mark_capacity, table_capacity;
};

/* 0 if out of memory. */
int tetlodi_star_lay_out(struct tetlodi_star_view *view, struct tetlodi_star_marks *marks,
                         const struct tetlodi_replay *replay, uint32_t vertex);
void tetlodi_star_fini(struct tetlodi_star_view *view, struct tetlodi_memory *memory);
void tetlodi_star_marks_fini(struct tetlodi_star_marks *marks, struct tetlodi_memory *memory);

/* The positions of the vertex and of a child are in place. */
void tetlodi_star_part(struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t child);

/* The link edge between two vertices that are there, none of them the star's own, of the star that was laid out last;
 * TETLOD_NONE: there is none. */
uint32_t tetlodi_star_edge(const struct tetlodi_star_view *view, const struct tetlodi_star_marks *marks, uint32_t x,
                           uint32_t y);

/* The corners of the tetrahedron that comes back at edge e between the split vertex and child (SPEC 7.4). */
void tetlodi_star_between(const struct tetlodi_star_view *view, const struct tetlodi_replay *replay, uint32_t e,
                          uint32_t child, uint32_t corners[4]);

/* The other orientation of a tetrahedron. */
static inline void corners_flip(uint32_t corners[4])
{
    uint32_t swap = corners[0];
    corners[0] = corners[1];
    corners[1] = swap;
}

/* Their positions. */
void tetlodi_star_between_points(const struct tetlodi_star_view *view, uint32_t e, const double *points[4]);

/* Two tetrahedra of a star at a time: each lane does what SPEC specifies for one. */
typedef double pair2 __attribute__((vector_size(16)));
typedef int64_t mask2 __attribute__((vector_size(16)));

struct corner2 {
    pair2 x, y, z;
};

/* Corners `k` but the vertex of tetrahedra i and i + 1 of the star, its last one twice if it is odd. */
TETLODI_INLINE struct corner2 corner2(const struct tetlodi_star_view *star, uint32_t i, int k)
{
    const double *p = star->positions[star->others[i][k]],
                 *q = star->positions[star->others[i + (i + 1 < star->size)][k]];
    return (struct corner2){{p[0], q[0]}, {p[1], q[1]}, {p[2], q[2]}};
}

#endif
