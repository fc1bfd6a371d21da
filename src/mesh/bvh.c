/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/bvh.h"

#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

struct coded {
    uint64_t code;
    uint32_t primitive;
};

static int compare_codes(const void *left, const void *right)
{
    const struct coded *a = left, *b = right;
    if (a->code != b->code)
        return a->code < b->code ? -1 : 1;
    return a->primitive < b->primitive ? -1 : a->primitive > b->primitive;
}

/* Two zero bits after each of the 21 low bits. */
static uint64_t spread_bits(uint64_t x)
{
    x = (x | x << 32) & 0x1f00000000ffffull;
    x = (x | x << 16) & 0x1f0000ff0000ffull;
    x = (x | x << 8) & 0x100f00f00f00f00full;
    x = (x | x << 4) & 0x10c30c30c30c30c3ull;
    return (x | x << 2) & 0x1249249249249249ull;
}

static void primitive_box(const double *positions, const uint32_t *corners, unsigned vertices, double box[6])
{
    for (int d = 0; d < 3; d++) {
        box[d] = INFINITY;
        box[d + 3] = -INFINITY;
        for (unsigned c = 0; c < vertices; c++) {
            double x = positions[3 * (size_t)corners[c] + d];
            box[d] = smaller(box[d], x);
            box[d + 3] = larger(box[d + 3], x);
        }
    }
}

static void morton_order(struct coded *coded, const double *positions, const uint32_t *primitives, uint32_t count,
                         unsigned vertices)
{
    double all[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY}, box[6];
    for (uint32_t i = 0; i < count; i++) {
        primitive_box(positions, primitives + (size_t)i * vertices, vertices, box);
        for (int d = 0; d < 3; d++) {
            all[d] = smaller(all[d], box[d]);
            all[d + 3] = larger(all[d + 3], box[d + 3]);
        }
    }
    for (uint32_t i = 0; i < count; i++) {
        primitive_box(positions, primitives + (size_t)i * vertices, vertices, box);
        uint64_t code = 0;
        for (int d = 0; d < 3; d++) {
            double extent = all[d + 3] - all[d], t = extent > 0 ? ((box[d] + box[d + 3]) / 2 - all[d]) / extent : 0;
            code |= spread_bits((uint64_t)(t * 0x1fffff)) << d;
        }
        coded[i] = (struct coded){code, i};
    }
    qsort(coded, count, sizeof *coded, compare_codes);
}

static void store_box(float *out, const double box[6])
{
    for (int d = 0; d < 3; d++) {
        out[d] = nextafterf((float)box[d], -INFINITY);
        out[d + 3] = nextafterf((float)box[d + 3], INFINITY);
    }
}

static void join_boxes(float *out, const float *a, const float *b)
{
    for (int d = 0; d < 3; d++) {
        out[d] = a[d] < b[d] ? a[d] : b[d];
        out[d + 3] = a[d + 3] > b[d + 3] ? a[d + 3] : b[d + 3];
    }
}

struct filling {
    struct bvh *bvh;
    const double *positions;
    const uint32_t *primitives;
    unsigned vertices;
};

static void fill_leaves(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct filling *filling = context;
    struct bvh *bvh = filling->bvh;
    (void)worker;
    for (size_t leaf = begin; leaf < end; leaf++) {
        double box[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY}, one[6];
        for (uint64_t i = (uint64_t)leaf * BVH_LEAF; i < bvh->count && i < ((uint64_t)leaf + 1) * BVH_LEAF; i++) {
            primitive_box(filling->positions, filling->primitives + (size_t)bvh->order[i] * filling->vertices,
                          filling->vertices, one);
            for (int d = 0; d < 3; d++) {
                box[d] = smaller(box[d], one[d]);
                box[d + 3] = larger(box[d + 3], one[d + 3]);
            }
        }
        store_box(bvh->boxes + 6 * (bvh->leaf_first + leaf), box);
    }
}

static void fill_boxes(struct bvh *bvh, const double *positions, const uint32_t *primitives, unsigned vertices,
                       unsigned threads)
{
    struct filling filling = {bvh, positions, primitives, vertices};
    parallel_for(threads, (size_t)bvh->leaf_first + 1, 1024, fill_leaves, &filling); // leaf_first + 1 leaves
    for (uint32_t node = bvh->leaf_first; node-- > 0;)
        join_boxes(bvh->boxes + 6 * (size_t)node, bvh->boxes + 6 * (2 * (size_t)node + 1),
                   bvh->boxes + 6 * (2 * (size_t)node + 2));
}

enum tetlod_status bvh_build(struct bvh *bvh, const double *positions, const uint32_t *primitives, uint32_t count,
                             unsigned vertices_per_primitive, struct tetlod_error *error)
{
    uint32_t *order = array_new(count, sizeof *order);
    struct coded *coded = array_new(count, sizeof *coded);
    if (!order || !coded) {
        free(order);
        free(coded);
        return tetlodi_fail_nomem(error, "a box hierarchy", (uint64_t)count * (sizeof *coded + 16));
    }
    morton_order(coded, positions, primitives, count, vertices_per_primitive);
    for (uint32_t i = 0; i < count; i++)
        order[i] = coded[i].primitive;
    free(coded);
    return bvh_build_ordered(bvh, positions, primitives, count, vertices_per_primitive, order, 1, error);
}

enum tetlod_status bvh_build_ordered(struct bvh *bvh, const double *positions, const uint32_t *primitives,
                                     uint32_t count, unsigned vertices_per_primitive, uint32_t *order, unsigned threads,
                                     struct tetlod_error *error)
{
    uint32_t leaves = 1, needed = count / BVH_LEAF + 1;
    while (leaves < needed)
        leaves *= 2;
    *bvh = (struct bvh){count, leaves - 1, order, array_new(2 * (size_t)leaves - 1, 6 * sizeof(float))};
    if (!bvh->boxes) {
        bvh_fini(bvh);
        return tetlodi_fail_nomem(error, "a box hierarchy", (uint64_t)leaves * 48);
    }
    fill_boxes(bvh, positions, primitives, vertices_per_primitive, threads);
    return TETLOD_OK;
}

void bvh_fini(struct bvh *bvh)
{
    free(bvh->order);
    free(bvh->boxes);
    *bvh = (struct bvh){0};
}

double bvh_box_distance2(const struct bvh *bvh, uint32_t node, const double p[3])
{
    const float *box = bvh->boxes + 6 * (size_t)node;
    double sum = 0;
    for (int d = 0; d < 3; d++) {
        double out = larger(larger(box[d] - p[d], p[d] - box[d + 3]), 0);
        sum += out * out;
    }
    return sum;
}

uint32_t bvh_find_box(const struct bvh *bvh, const double box[6], uint32_t *out, uint32_t most)
{
    struct bvh_walk walk = bvh_walk_begin(bvh);
    uint32_t found = 0, first, end;
    while (bvh_next_leaf(&walk, box, &first, &end))
        for (uint32_t i = first; i < end; i++, found++)
            if (found < most)
                out[found] = bvh->order[i];
    return found;
}
