/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/bvh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A primitive, by the middle of its box. */
struct item {
    float middle[3];
    uint32_t primitive;
};

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

static bool is_before(const struct item *a, const struct item *b, int axis)
{
    return a->middle[axis] != b->middle[axis] ? a->middle[axis] < b->middle[axis] : a->primitive < b->primitive;
}

static void exchange(struct item *a, struct item *b)
{
    struct item kept = *a;
    *a = *b;
    *b = kept;
}

/* Moves the `wanted` least along an axis to the beginning. */
static void select_least(struct item *items, size_t count, size_t wanted, int axis)
{
    size_t low = 0, high = count; // what is outside of them is where it belongs
    while (low < wanted && wanted < high && high - low > 1) {
        struct item pivot = items[low + (high - low - 1) / 2]; // never the last, so that both parts have some
        size_t i = low, j = high - 1;
        for (;; i++, j--) {
            while (is_before(&items[i], &pivot, axis))
                i++;
            while (is_before(&pivot, &items[j], axis))
                j--;
            if (i >= j)
                break;
            exchange(&items[i], &items[j]);
        }
        if (j + 1 <= wanted)
            low = j + 1;
        else
            high = j + 1;
    }
}

/* The axis along which the items lie farthest apart. */
static int longest_axis(const struct item *items, size_t count)
{
    float low[3], high[3];
    int longest = 0;
    memcpy(low, items[0].middle, sizeof low);
    memcpy(high, low, sizeof high);
    for (size_t i = 1; i < count; i++)
        for (int d = 0; d < 3; d++) {
            low[d] = items[i].middle[d] < low[d] ? items[i].middle[d] : low[d];
            high[d] = items[i].middle[d] > high[d] ? items[i].middle[d] : high[d];
        }
    for (int d = 1; d < 3; d++)
        if (high[d] - low[d] > high[longest] - low[longest])
            longest = d;
    return longest;
}

/* Items of a node with so many leaves below it: as many as the first half of them holds go there, the least along one
 * axis. */
static void order_items(struct item *items, size_t count, uint32_t leaves, uint32_t leaf)
{
    for (; count > leaf; leaves /= 2) {
        size_t half = (size_t)leaves / 2 * leaf;
        if (count <= half)
            continue;
        select_least(items, count, half, longest_axis(items, count));
        order_items(items + half, count - half, leaves / 2, leaf);
        count = half;
    }
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

static void fill_leaf(struct bvh *bvh, uint32_t leaf, const double *positions, const uint32_t *primitives,
                      unsigned vertices)
{
    double box[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY}, one[6];
    uint64_t first = (uint64_t)leaf * bvh->leaf;
    for (uint64_t i = first; i < bvh->count && i < first + bvh->leaf; i++) {
        primitive_box(positions, primitives + (size_t)bvh->order[i] * vertices, vertices, one);
        for (int d = 0; d < 3; d++) {
            box[d] = smaller(box[d], one[d]);
            box[d + 3] = larger(box[d + 3], one[d + 3]);
        }
    }
    store_box(bvh->boxes + 6 * ((size_t)bvh->leaf_first + leaf), box);
}

static void fill_boxes(struct bvh *bvh, const double *positions, const uint32_t *primitives, unsigned vertices)
{
    for (uint32_t leaf = 0; leaf <= bvh->leaf_first; leaf++) // one more than there are other nodes
        fill_leaf(bvh, leaf, positions, primitives, vertices);
    for (uint32_t node = bvh->leaf_first; node-- > 0;)
        join_boxes(bvh->boxes + 6 * (size_t)node, bvh->boxes + 6 * (2 * (size_t)node + 1),
                   bvh->boxes + 6 * (2 * (size_t)node + 2));
}

static uint32_t count_leaves(uint32_t count, uint32_t leaf)
{
    uint32_t leaves = 1, needed = count / leaf + 1;
    while (leaves < needed)
        leaves *= 2;
    return leaves;
}

uint64_t bvh_building_bytes(uint32_t count, uint32_t leaf)
{
    const uint64_t boxes = count_leaves(count, leaf) * (uint64_t)(12 * sizeof(float));
    return count * (uint64_t)(sizeof(struct item) + sizeof(uint32_t)) + boxes;
}

enum tetlod_status bvh_build(struct bvh *bvh, const double *positions, const uint32_t *primitives, uint32_t count,
                             unsigned vertices_per_primitive, uint32_t leaf, struct tetlod_error *error)
{
    const uint32_t leaves = count_leaves(count, leaf);
    struct item *items = array_new(count, sizeof *items);
    *bvh = (struct bvh){.count = count,
                        .leaf_first = leaves - 1,
                        .leaf = leaf,
                        .order = array_new(count, sizeof *bvh->order),
                        .boxes = array_new(2 * (size_t)leaves - 1, 6 * sizeof(float))};
    if (!items || !bvh->order || !bvh->boxes) {
        free(items);
        bvh_fini(bvh);
        return tetlodi_fail_nomem(error, "a box hierarchy", bvh_building_bytes(count, leaf));
    }
    for (uint32_t i = 0; i < count; i++) {
        double box[6];
        primitive_box(positions, primitives + (size_t)i * vertices_per_primitive, vertices_per_primitive, box);
        for (int d = 0; d < 3; d++)
            items[i].middle[d] = (float)(box[d] / 2 + box[d + 3] / 2);
        items[i].primitive = i;
    }
    order_items(items, count, leaves, leaf);
    for (uint32_t i = 0; i < count; i++)
        bvh->order[i] = items[i].primitive;
    free(items);
    fill_boxes(bvh, positions, primitives, vertices_per_primitive);
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
