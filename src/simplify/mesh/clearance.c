/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/clearance.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/locate.h"
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Faces of one body whose normals have a cosine below this are other parts of the boundary to each other. */
static const double TURNED = -0.2;

/* A boundary may move by this fraction of the distance of the next part: two that move, and points that they have
 * passed, then stay apart. */
static const double SHARE = 0.2;

/* A vertex is inside a tetrahedron if all its weights are above this. */
static const double INSIDE = 1e-9;

struct clearance {
    const struct clearance_mesh *mesh;
    double most;
    uint32_t *body;      /* [vertex] the least vertex of its body */
    double *normals;     /* [3 * triangle] of length 1, or 0 */
    double *shares;      /* [triangle] */
    uint32_t *vertices;  /* [vertex_boxes.count] those of the boundary */
    uint8_t *overlapped; /* [vertex] it is inside a tetrahedron */
    struct bvh triangle_boxes, vertex_boxes;
};

static const double *position_of(const struct clearance *c, uint32_t vertex)
{
    return c->mesh->positions + 3 * (size_t)vertex;
}

static const uint32_t *triangle_of(const struct clearance *c, uint32_t face)
{
    return c->mesh->triangles + 3 * (size_t)face;
}

static void find_normals(struct clearance *c)
{
    for (uint32_t f = 0; f < c->mesh->triangle_count; f++) {
        const uint32_t *v = triangle_of(c, f);
        double *n = c->normals + 3 * (size_t)f;
        triangle_cross(position_of(c, v[0]), position_of(c, v[1]), position_of(c, v[2]), n);
        double length = sqrt(dot(n, n));
        for (int i = 0; i < 3; i++)
            n[i] = length > 0 ? n[i] / length : 0;
    }
}

/* Is face g another part of the boundary than f? */
static bool another_part(const struct clearance *c, uint32_t f, uint32_t g)
{
    const uint32_t *a = triangle_of(c, f), *b = triangle_of(c, g);
    if (c->body[a[0]] != c->body[b[0]])
        return true;
    if (!(dot(c->normals + 3 * (size_t)f, c->normals + 3 * (size_t)g) < TURNED))
        return false;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (a[i] == b[k])
                return false;
    return true;
}

/* The box of some vertices, grown to all sides. */
static void box_of(const struct clearance *c, const uint32_t *vertices, int count, double grown, double box[6])
{
    for (int i = 0; i < 3; i++) {
        box[i] = INFINITY;
        box[i + 3] = -INFINITY;
        for (int k = 0; k < count; k++) {
            double x = position_of(c, vertices[k])[i];
            box[i] = smaller(box[i], x - grown);
            box[i + 3] = larger(box[i + 3], x + grown);
        }
    }
}

/* Are two triangles more than `most` apart along a direction, rounding aside? */
static bool apart_along(const double direction[3], const double *const p[3], const double *const q[3], double most)
{
    static const double rounding = 1e-12;
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, size = 0, r[3];
    for (int k = 0; k < 6; k++) {
        subtract(k < 3 ? p[k] : q[k - 3], p[0], r);
        double along = dot(direction, r);
        low[k / 3] = smaller(low[k / 3], along);
        high[k / 3] = larger(high[k / 3], along);
        size = larger(size, fabs(r[0]) + fabs(r[1]) + fabs(r[2]));
    }
    return larger(low[1] - high[0], low[0] - high[1]) > (most + rounding * size) * sqrt(dot(direction, direction));
}

static void longest_edge(const double *const p[3], double out[3])
{
    double edge[3];
    subtract(p[1], p[0], out);
    for (int k = 1; k < 3; k++) {
        subtract(p[(k + 1) % 3], p[k], edge);
        if (dot(edge, edge) > dot(out, out))
            memcpy(out, edge, sizeof edge);
    }
}

/* Far from each other for a reason that is cheap to see? Needles around one point have boxes that all meet. */
static bool surely_farther(const double normal_p[3], const double normal_q[3], const double *const p[3],
                           const double *const q[3],
                           double most)
{
    double a[3], b[3], across[3];
    if (apart_along(normal_p, p, q, most) || apart_along(normal_q, p, q, most))
        return true;
    longest_edge(p, a);
    longest_edge(q, b);
    cross(a, b, across);
    return apart_along(across, p, q, most);
}

/* The distance of face f from the next other part, if that is below `most`; else `most`. */
static double distance_of(const struct clearance *c, uint32_t f, double most)
{
    struct bvh_walk walk = bvh_walk_begin(&c->triangle_boxes);
    const double *p[3], *q[3];
    double box[6];
    uint32_t first, end;
    for (int k = 0; k < 3; k++)
        p[k] = position_of(c, triangle_of(c, f)[k]);
    box_of(c, triangle_of(c, f), 3, most, box);
    while (most > 0 && bvh_next_leaf(&walk, box, &first, &end))
        for (uint32_t i = first; i < end; i++) {
            uint32_t g = c->triangle_boxes.order[i];
            if (!another_part(c, f, g))
                continue;
            for (int k = 0; k < 3; k++)
                q[k] = position_of(c, triangle_of(c, g)[k]);
            if (surely_farther(c->normals + 3 * (size_t)f, c->normals + 3 * (size_t)g, p, q, most))
                continue;
            double distance = sqrt(triangles_distance2(p, q));
            if (distance >= most)
                continue;
            most = distance;
            box_of(c, triangle_of(c, f), 3, most, box);
        }
    return most;
}

static void share_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct clearance *c = context;
    (void)worker;
    for (size_t f = begin; f < end; f++)
        c->shares[f] = SHARE * distance_of(c, (uint32_t)f, c->most / SHARE);
}

static bool in_box(const double box[6], const double p[3])
{
    return p[0] >= box[0] && p[1] >= box[1] && p[2] >= box[2] && p[0] <= box[3] && p[1] <= box[4] && p[2] <= box[5];
}

/* Which boundary vertices are inside one of `count` tetrahedra of others? `boxes` are the tetrahedra's, `box` holds
 * them all. */
static void mark_overlapped(struct clearance *c, uint32_t tet, uint32_t count, double (*boxes)[6], const double box[6])
{
    struct bvh_walk walk = bvh_walk_begin(&c->vertex_boxes);
    const struct locator locator = {.positions = c->mesh->positions, .corners = c->mesh->corners};
    double weights[4];
    uint32_t first, end;
    while (bvh_next_leaf(&walk, box, &first, &end))
        for (uint32_t i = first; i < end; i++) {
            uint32_t v = c->vertices[c->vertex_boxes.order[i]];
            const double *p = position_of(c, v);
            if (!in_box(box, p))
                continue;
            for (uint32_t t = 0; t < count; t++) {
                const uint32_t *corners = c->mesh->corners + 4 * (size_t)(tet + t);
                if (in_box(boxes[t], p) && corners[0] != v && corners[1] != v && corners[2] != v && corners[3] != v &&
                    locator_weights(&locator, tet + t, p, weights) > INSIDE)
                    __atomic_store_n(&c->overlapped[v], 1, __ATOMIC_RELAXED);
            }
        }
}

/* Only where the mesh overlaps itself there are any. Tetrahedra that are near each other are looked up together. */
static void overlap_range(void *context, unsigned worker, size_t begin, size_t end)
{
    enum { TOGETHER = 16, WIDER = 4 }; // their box is so many times the widest one's at most
    struct clearance *c = context;
    (void)worker;
    for (size_t tet = begin; tet < end; tet += TOGETHER) {
        uint32_t count = (uint32_t)(end - tet < TOGETHER ? end - tet : TOGETHER);
        const uint32_t *corners = c->mesh->corners + 4 * tet;
        double boxes[TOGETHER][6], all[6], widest[3] = {0, 0, 0};
        bool near = true;
        box_of(c, corners, 4 * (int)count, 0, all);
        for (uint32_t t = 0; t < count; t++) {
            box_of(c, corners + 4 * (size_t)t, 4, 0, boxes[t]);
            for (int i = 0; i < 3; i++)
                widest[i] = larger(widest[i], boxes[t][i + 3] - boxes[t][i]);
        }
        for (int i = 0; i < 3; i++)
            near &= all[i + 3] - all[i] <= WIDER * widest[i];
        if (near)
            mark_overlapped(c, (uint32_t)tet, count, boxes, all);
        for (uint32_t t = 0; t < count && !near; t++)
            mark_overlapped(c, (uint32_t)tet + t, 1, boxes + t, boxes[t]);
    }
}

/* The boundary's triangles and vertices in boxes. */
static enum tetlod_status fill_boxes(struct clearance *c, struct tetlod_error *error)
{
    uint32_t count = 0;
    TETLOD_TRY(bvh_build(&c->triangle_boxes, c->mesh->positions, c->mesh->triangles, c->mesh->triangle_count, 3,
                         BVH_LEAF, error));
    for (size_t i = 0; i < 3 * (size_t)c->mesh->triangle_count; i++) {
        uint32_t v = c->mesh->triangles[i];
        if (!c->overlapped[v])
            c->vertices[count++] = v;
        c->overlapped[v] = 1;
    }
    memset(c->overlapped, 0, c->mesh->vertex_count);
    return bvh_build(&c->vertex_boxes, c->mesh->positions, c->vertices, count, 1, BVH_LEAF, error);
}

enum tetlod_status clearance_find(const struct clearance_mesh *mesh, double most, double least, unsigned threads,
                                  double *out,
                                  struct tetlod_error *error)
{
    size_t n = mesh->vertex_count, triangles = mesh->triangle_count;
    struct clearance c = {.mesh = mesh,
                          .most = most,
                          .body = array_new(n, sizeof(uint32_t)),
                          .normals = array_new(triangles, 3 * sizeof(double)),
                          .shares = array_new(triangles, sizeof(double)),
                          .vertices = array_new(n, sizeof(uint32_t)),
                          .overlapped = array_zero(n, 1)};
    enum tetlod_status status = TETLOD_OK;
    if (!c.body || !c.normals || !c.shares || !c.vertices || !c.overlapped)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the boundary", n * 9 + triangles * 32));
    TETLOD_TRY_DONE(fill_boxes(&c, error));
    sheets_bodies(mesh->corners, mesh->tet_count, mesh->vertex_count, c.body);
    find_normals(&c);
    parallel_for(threads, triangles, 256, share_range, &c);
    parallel_for(threads, mesh->tet_count, 4096, overlap_range, &c);
    for (size_t v = 0; v < n; v++)
        out[v] = c.overlapped[v] ? least : most;
    for (size_t i = 0; i < 3 * triangles; i++)
        out[mesh->triangles[i]] = smaller(out[mesh->triangles[i]], c.shares[i / 3]);
    for (size_t v = 0; v < n; v++)
        out[v] = larger(out[v], least);
done:
    bvh_fini(&c.triangle_boxes);
    bvh_fini(&c.vertex_boxes);
    free(c.body);
    free(c.normals);
    free(c.shares);
    free(c.vertices);
    free(c.overlapped);
    return status;
}
