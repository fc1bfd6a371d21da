/* SPDX-License-Identifier: BSD-3-Clause */
/* A balanced hierarchy of boxes over primitives, halved along the longest axis: implicit, a node's children are 2i+1
 * and 2i+2. */
#ifndef TETLOD_BVH_H
#define TETLOD_BVH_H

#include <stdbool.h>

#include "format/tetlod.h"

struct bvh {
    uint32_t count;      /* primitives */
    uint32_t leaf_first; /* number of the first leaf node */
    uint32_t leaf;       /* primitives in one */
    uint32_t *order;     /* [count] primitives in leaf order; leaf l holds order[leaf * l .. leaf * (l + 1)) */
    float *boxes;        /* [6 * node] lower corner, upper corner, rounded outwards */
};

enum { BVH_LEAF = 4, BVH_DEPTH = 40 };

/* Over `count` primitives with the given corner points each (1, 3 or 4 vertices), `leaf` of them in a leaf: BVH_LEAF,
 * where nothing is known of more. ERR_NOMEM. O(n log n). */
TETLOD_CHECKED enum tetlod_status bvh_build(struct bvh *bvh, const double *positions, const uint32_t *primitives,
                                            uint32_t count,
                                            unsigned vertices_per_primitive, uint32_t leaf, struct tetlod_error *error);
void bvh_fini(struct bvh *bvh);

/* Memory that building takes. */
uint64_t bvh_building_bytes(uint32_t count, uint32_t leaf);

/* Square of the distance of p from a node's box; 0 inside. */
double bvh_box_distance2(const struct bvh *bvh, uint32_t node, const double p[3]);

/* A walk through the leaves that meet a box. */
struct bvh_walk {
    const struct bvh *bvh;
    uint32_t depth, stack[BVH_DEPTH];
};

static inline struct bvh_walk bvh_walk_begin(const struct bvh *bvh)
{
    return (struct bvh_walk){.bvh = bvh, .depth = 1}; // at the root, 0
}

/* Do a box and a node's (lower corner, upper corner) meet? */
static inline bool bvh_boxes_meet(const double box[6], const float own[6])
{
    bool meets = true;
    for (int d = 0; d < 3; d++)
        meets &= !((double)own[d] > box[d + 3] || (double)own[d + 3] < box[d]);
    return meets;
}

/* The next leaf whose own box, and those of all nodes above it, `meets` says true of: it holds order[*out_first ..
 * *out_end). */
static inline bool bvh_next_leaf_where(struct bvh_walk *walk, bool (*meets)(const void *context, const float own[6]),
                                       const void *context,
                                       uint32_t *out_first, uint32_t *out_end)
{
    const struct bvh *bvh = walk->bvh;
    while (walk->depth) {
        uint32_t node = walk->stack[--walk->depth];
        if (!meets(context, bvh->boxes + 6 * (size_t)node))
            continue;
        if (node >= bvh->leaf_first) {
            uint64_t first = (uint64_t)(node - bvh->leaf_first) * bvh->leaf, end = first + bvh->leaf;
            *out_first = (uint32_t)(first < bvh->count ? first : bvh->count);
            *out_end = (uint32_t)(end < bvh->count ? end : bvh->count);
            if (first < bvh->count) // the last leaves are empty
                return true;
            continue;
        }
        walk->stack[walk->depth++] = 2 * node + 2;
        walk->stack[walk->depth++] = 2 * node + 1;
    }
    return false;
}

static inline bool bvh_meets_box(const void *box, const float own[6])
{
    return bvh_boxes_meet(box, own);
}

/* The next leaf that meets a box (lower corner, upper corner), which may have shrunk since the last. */
static inline bool bvh_next_leaf(struct bvh_walk *walk, const double box[6], uint32_t *out_first, uint32_t *out_end)
{
    return bvh_next_leaf_where(walk, bvh_meets_box, box, out_first, out_end);
}

/* Primitives of the leaves that meet a box (lower corner, upper corner): all that meet it, and some near it. Their
 * number is returned, of which the first `most` are written. */
uint32_t bvh_find_box(const struct bvh *bvh, const double box[6], uint32_t *out, uint32_t most);

#endif
