/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The transition of a region beside the finest level: which of the finest tetrahedra may differ from it by more than is
 * known already.
 *
 *   1. A grid over the transition knows which values the transition has in each cell (value_grid.h).
 *   2. A finest tetrahedron may be far off if a cell that it touches has a value that is far from one of its corners'.
 *
 * Each body is compared with itself: a tetrahedron of a region is in the body of the finest tetrahedron that it is made
 * of.
 */
#ifndef TETLOD_TRANSITION_H
#define TETLOD_TRANSITION_H

#include "src/stream/region.h"
#include "src/measure/value_grid.h"

/* The fields that are compared, controlled ones and those with a local bound, and their components in a row. */
struct transition_fields {
    uint32_t count, width;
    uint32_t *fields, *places; /* [count]; 0, 1, 2 ... */
    uint32_t *of;              /* [width] place in `fields` */
};

/* The finest level. */
struct finest {
    uint32_t vertices, tets;
    double *positions, *values; /* [vertex] 3, width */
    uint8_t (*cells)[3];        /* [vertex] of the grid */
    uint32_t *corners;          /* [4 * tet] */
    uint32_t *bodies;           /* [vertex] */
};

struct transition {
    const struct forest *forest;
    struct room *room;            /* may be NULL */
    const struct tetmesh *region; /* borrowed */
    struct transition_fields fields;
    struct tetmesh tets;          /* the transition: borrows all but its corners */
    /* the same and what lies near of the region's other parts; borrows all but its corners */
    struct tetmesh near;
    uint8_t *wanted;              /* [tet of `near`] it is of the transition */
    uint32_t *bodies;             /* [vertex of the region] as those of the finest level */
    struct value_grid grid;       /* of `tets` */
    struct finest finest;
};

/* Some of the finest tetrahedra. */
struct finest_part {
    struct tetmesh mesh; /* its fields are those that are compared, in order */
    uint32_t *bodies;    /* [vertex] */
};

/* `tets`: of each of the region's tetrahedra its number in the fine level. The forest has the finest level. Where there
 * is no transition, transition->tets is empty and nothing else is there. ERR_NOMEM, and what the room says, which then
 * holds what is there. */
TETLOD_CHECKED enum tetlod_status transition_init(struct transition *transition, const struct forest *forest,
                                                  const struct tetmesh *region, const uint32_t *tets,
                                                  struct room *room, struct tetlod_error *error);
void transition_fini(struct transition *transition);

/* The finest tetrahedra that may differ from the transition by more than limits[compared field]; a limit below 0: all
 * that lie near. The
 * room holds the part afterwards. */
TETLOD_CHECKED enum tetlod_status transition_far(const struct transition *transition, const double *limits,
                                                 struct finest_part *out,
                                                 struct tetlod_error *error);
void finest_part_fini(struct finest_part *part);

#endif
