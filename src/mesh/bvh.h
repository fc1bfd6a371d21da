/* SPDX-License-Identifier: BSD-3-Clause */
/* A balanced hierarchy of boxes over primitives in Morton order: implicit, a node's children are 2i+1 and 2i+2. */
#ifndef TETLOD_BVH_H
#define TETLOD_BVH_H

#include "format/tetlod.h"

struct bvh {
    uint32_t count;      /* primitives */
    uint32_t leaf_first; /* number of the first leaf node */
    uint32_t *order;     /* [count] primitives in leaf order; leaf l holds order[4l .. 4l+4) */
    float *boxes;        /* [6 * node] lower corner, upper corner, rounded outwards */
};

enum { BVH_LEAF = 4, BVH_DEPTH = 40 };

/* Over `count` primitives with the given corner points each (3 or 4 vertices). ERR_NOMEM. O(n log n). */
TETLOD_CHECKED enum tetlod_status bvh_build(struct bvh *bvh, const double *positions, const uint32_t *primitives,
                                            uint32_t count, unsigned vertices_per_primitive, struct tetlod_error *error);

/* The same with an order that keeps neighbours together, which it takes over (also when it fails). O(n). */
TETLOD_CHECKED enum tetlod_status bvh_build_ordered(struct bvh *bvh, const double *positions, const uint32_t *primitives,
                                                    uint32_t count, unsigned vertices_per_primitive, uint32_t *order,
                                                    unsigned threads, struct tetlod_error *error);
void bvh_fini(struct bvh *bvh);

/* Square of the distance of p from a node's box; 0 inside. */
double bvh_box_distance2(const struct bvh *bvh, uint32_t node, const double p[3]);

/* Primitives of the leaves that meet a box (lower corner, upper corner): all that meet it, and some near it. Their number is
 * returned, of which the first `most` are written. */
uint32_t bvh_find_box(const struct bvh *bvh, const double box[6], uint32_t *out, uint32_t most);

#endif
