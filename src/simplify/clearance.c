/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/clearance.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/locate.h"
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* Faces of one body whose normals have a cosine below this are other parts of the boundary to each other. */
static const double TURNED = -0.2;

/* A boundary may move by this fraction of the distance of the next part: two that move, and points that they have passed, then stay
 * apart. */
static const double SHARE = 0.2;

/* A vertex is inside a tetrahedron if all its weights are above this. */
static const double INSIDE = 1e-9;

struct clearance {
    struct locator locator;
    uint32_t vertex_count;
    uint32_t *body;   /* [vertex] the least vertex of its body */
    double *normals;  /* [3 * triangle] of length 1, or 0 */
    uint32_t *holding; /* [holding_room] one more than any vertex has tetrahedra */
    uint32_t holding_room;
    double *out;
};

static void find_normals(struct clearance *c)
{
    for (uint32_t f = 0; f < c->locator.surface.count; f++) {
        const double *p[3];
        double *n = c->normals + 3 * (size_t)f;
        for (int k = 0; k < 3; k++)
            p[k] = c->locator.positions + 3 * (size_t)c->locator.surface.triangles[3 * (size_t)f + (size_t)k];
        triangle_cross(p[0], p[1], p[2], n);
        double length = sqrt(dot(n, n));
        for (int i = 0; i < 3; i++)
            n[i] = length > 0 ? n[i] / length : 0;
    }
}

/* Is face g another part of the boundary than f? */
static bool another_part(const struct clearance *c, uint32_t f, uint32_t g)
{
    const uint32_t *a = c->locator.surface.triangles + 3 * (size_t)f, *b = c->locator.surface.triangles + 3 * (size_t)g;
    if (c->body[a[0]] != c->body[b[0]])
        return true;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (a[i] == b[k])
                return false;
    return dot(c->normals + 3 * (size_t)f, c->normals + 3 * (size_t)g) < TURNED;
}

static void triangle_box(const struct clearance *c, uint32_t f, double grown, double box[6])
{
    for (int i = 0; i < 3; i++) {
        box[i] = INFINITY;
        box[i + 3] = -INFINITY;
        for (int k = 0; k < 3; k++) {
            double x = c->locator.positions[3 * (size_t)c->locator.surface.triangles[3 * (size_t)f + (size_t)k] + (size_t)i];
            box[i] = smaller(box[i], x - grown);
            box[i + 3] = larger(box[i + 3], x + grown);
        }
    }
}

static bool meets_node(const struct bvh *bvh, uint32_t node, const double box[6])
{
    const float *other = bvh->boxes + 6 * (size_t)node;
    for (int i = 0; i < 3; i++)
        if ((double)other[i] > box[i + 3] || (double)other[i + 3] < box[i])
            return false;
    return true;
}

/* The distance of face f from the next other part, if that is below `most`; else `most`. */
static double distance_of(const struct clearance *c, uint32_t f, double most)
{
    const struct bvh *bvh = &c->locator.surface.boxes;
    uint32_t stack[BVH_DEPTH], depth = 0;
    const double *p[3], *q[3];
    double box[6];
    for (int k = 0; k < 3; k++)
        p[k] = c->locator.positions + 3 * (size_t)c->locator.surface.triangles[3 * (size_t)f + (size_t)k];
    triangle_box(c, f, most, box);
    stack[depth++] = 0;
    while (depth && most > 0) {
        uint32_t node = stack[--depth];
        if (!meets_node(bvh, node, box))
            continue;
        if (node < bvh->leaf_first) {
            stack[depth++] = 2 * node + 2;
            stack[depth++] = 2 * node + 1;
            continue;
        }
        uint64_t first = (uint64_t)(node - bvh->leaf_first) * BVH_LEAF;
        for (uint64_t i = first; i < bvh->count && i < first + BVH_LEAF; i++) {
            if (!another_part(c, f, bvh->order[i]))
                continue;
            for (int k = 0; k < 3; k++)
                q[k] = c->locator.positions + 3 * (size_t)c->locator.surface.triangles[3 * (size_t)bvh->order[i] + (size_t)k];
            double distance = sqrt(triangles_distance2(p, q));
            if (distance >= most)
                continue;
            most = distance;
            triangle_box(c, f, most, box);
        }
    }
    return most;
}

/* Is a boundary vertex inside a tetrahedron? Only where the mesh overlaps itself. */
static bool overlapped(const struct clearance *c, uint32_t v)
{
    double weights[4];
    const double *p = c->locator.positions + 3 * (size_t)v;
    uint32_t count = locator_find(&c->locator, p, c->holding, c->holding_room);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *corners = c->locator.corners + 4 * (size_t)c->holding[i];
        if (corners[0] != v && corners[1] != v && corners[2] != v && corners[3] != v &&
            locator_weights(&c->locator, c->holding[i], p, weights) > INSIDE)
            return true;
    }
    return count == c->holding_room; // so many cannot all be its own
}

/* Room for all tetrahedra of any vertex and one more. */
static bool make_holding(struct clearance *c)
{
    uint32_t *stars = array_zero(c->vertex_count, sizeof *stars);
    for (size_t i = 0; stars && i < 4 * (size_t)c->locator.tet_count; i++) {
        uint32_t count = ++stars[c->locator.corners[i]];
        c->holding_room = count + 1 > c->holding_room ? count + 1 : c->holding_room;
    }
    bool done = stars;
    free(stars);
    c->holding = array_new(c->holding_room, sizeof *c->holding);
    return done && c->holding;
}

static void find_all(struct clearance *c, double most, double least)
{
    for (uint32_t v = 0; v < c->vertex_count; v++)
        c->out[v] = most;
    for (uint32_t f = 0; f < c->locator.surface.count; f++) {
        const uint32_t *corners = c->locator.surface.triangles + 3 * (size_t)f;
        double share = SHARE * distance_of(c, f, most / SHARE);
        for (int k = 0; k < 3; k++)
            c->out[corners[k]] = smaller(c->out[corners[k]], share);
    }
    for (size_t i = 0; i < 3 * (size_t)c->locator.surface.count; i++) {
        uint32_t v = c->locator.surface.triangles[i];
        if (c->out[v] > least && overlapped(c, v))
            c->out[v] = least;
    }
    for (uint32_t v = 0; v < c->vertex_count; v++)
        c->out[v] = larger(c->out[v], least);
}

enum tetlod_status clearance_find(const double *positions, uint32_t vertex_count, const uint32_t *corners, uint32_t tet_count,
                                  double most, double least, double *out, struct tetlod_error *error)
{
    struct clearance c = {.vertex_count = vertex_count, .out = out, .body = array_new(vertex_count, sizeof(uint32_t))};
    enum tetlod_status status = TETLOD_OK;
    if (!c.body)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the boundary", vertex_count * (uint64_t)4));
    TETLOD_TRY_DONE(locator_init(&c.locator, positions, vertex_count, corners, tet_count, error));
    c.normals = array_new(c.locator.surface.count, 3 * sizeof(double));
    if (!make_holding(&c) || !c.normals)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the boundary", c.locator.surface.count * (uint64_t)24));
    sheets_bodies(corners, tet_count, vertex_count, c.body);
    find_normals(&c);
    find_all(&c, most, least);
done:
    locator_fini(&c.locator);
    free(c.normals);
    free(c.holding);
    free(c.body);
    return status;
}
