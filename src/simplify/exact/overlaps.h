/* SPDX-License-Identifier: BSD-3-Clause */
/* Which tetrahedra of the original overlap which of the level, under the exact limit; and where contractions were
 * refused. */
#ifndef TETLOD_OVERLAPS_H
#define TETLOD_OVERLAPS_H

#include "src/simplify/limit.h"

/* A point on an edge of the original; `ends` may be twice the same vertex, or TETLOD_NONE: no such point. */
struct watched {
    uint32_t ends[2];
    float along; /* 0 .. 1 */
};

/* The same, and the tetrahedron of the level that it is in. */
struct sentinel {
    uint32_t tet;
    struct watched point;
};

/* A point near which contractions were refused, and the number of the one before it. */
struct watch {
    struct watched point;
    uint32_t next; /* TETLOD_NONE: it is the last */
};

enum { MAX_WATCHES = 2 }; /* of a tetrahedron */

static const uint32_t OVERLAPS_POOLED = UINT32_C(1) << 31;

/* Which original tetrahedra overlap which of the level. */
struct overlaps {
    const struct tetmesh *mesh; /* the original, borrowed */
    /* [tet of the level] the original that it is, or OVERLAPS_POOLED and where its list begins; TETLOD_NONE: none */
    uint32_t *lists;
    /* list after list: its tetrahedron of the level, how many originals it has, and these */
    uint32_t *pool;
    size_t pool_size, pool_capacity;
    float *slopes;              /* [original tet] (longest edge)^2 / 6V, rounded up; 0: it has no volume */
    uint32_t *sentinels;        /* [tet of the level] its last watch, or TETLOD_NONE: most have none */
    struct watch *watches;
    size_t watch_count, watch_capacity;
    /* [original vertex] the tetrahedron of the level that it is in: a hint, what to look at first */
    uint32_t *host;
};

/* For the working of the mesh before its first contraction. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status overlaps_init(struct overlaps *overlaps, const struct tetmesh *mesh,
                                                const struct working *working,
                                                struct tetlod_error *error);
void overlaps_fini(struct overlaps *overlaps);

/* Bytes that they take, about. */
uint64_t overlaps_bytes(uint32_t vertices, uint32_t tets);

/* Sets up a sentinel in place of its tetrahedron's oldest. Without memory there is none, which only takes time. */
void overlaps_watch(struct overlaps *overlaps, const struct sentinel *sentinel);

/* The originals that overlap a tetrahedron of the level, until the next call that changes them. */
static inline const uint32_t *overlaps_of(const struct overlaps *overlaps, uint32_t tet, uint32_t *out_count)
{
    const uint32_t *list = &overlaps->lists[tet];
    *out_count = *list != TETLOD_NONE;
    if (!*out_count || !(*list & OVERLAPS_POOLED))
        return list;
    list = overlaps->pool + (*list & ~OVERLAPS_POOLED);
    *out_count = list[-1];
    return list;
}

/* Tetrahedra of the level have other numbers now. */
void overlaps_renumber(struct overlaps *overlaps, const struct renumbering *numbers);

/* With the contraction of a star that has not changed since: takes its lists over. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status overlaps_take(struct overlaps *overlaps, const struct star *star,
                                                const struct passed *passed, struct tetlod_error *error);

#endif
