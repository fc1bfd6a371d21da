/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/locate.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/util/array.h"

/* A point this far outside by a barycentric weight is on the face: the rounding of well shaped tetrahedra is far below. */
static const double ON_FACE = -1e-9;

static enum tetlod_status collect_boundary(struct locator *locator, struct tetlod_error *error)
{
    size_t slots = 4 * (size_t)locator->tet_count, count = 0;
    const uint32_t *neighbours = locator->neighbours;
    for (size_t s = 0; s < slots; s++)
        count += neighbours[s] == TETLOD_NONE;
    locator->triangles = array_new(count, 3 * sizeof(uint32_t));
    locator->faces = array_new(count, sizeof(uint32_t));
    if (!locator->triangles || !locator->faces)
        return tetlodi_fail_nomem(error, "the boundary", count * 16);
    for (size_t s = 0; s < slots; s++)
        if (neighbours[s] == TETLOD_NONE) {
            for (int i = 0; i < 3; i++)
                locator->triangles[3 * (size_t)locator->triangle_count + i] =
                    locator->corners[(s & ~(size_t)3) + tet_faces[s & 3][i]];
            locator->faces[locator->triangle_count++] = (uint32_t)s;
        }
    return TETLOD_OK;
}

/* What is left when the neighbours are there and the tetrahedra have their boxes. */
static enum tetlod_status complete(struct locator *locator, uint32_t vertex_count, struct tetlod_error *error)
{
    locator->tet_of = array_new(vertex_count, sizeof(uint32_t));
    if (!locator->tet_of)
        return tetlodi_fail_nomem(error, "a locator", 4 * (uint64_t)vertex_count);
    for (size_t c = 0; c < 4 * (size_t)locator->tet_count; c++)
        locator->tet_of[locator->corners[c]] = (uint32_t)(c / 4);
    TETLOD_TRY(collect_boundary(locator, error));
    return bvh_build(&locator->surface, locator->positions, locator->triangles, locator->triangle_count, 3, error);
}

enum tetlod_status locator_init(struct locator *locator, const double *positions, uint32_t vertex_count,
                                const uint32_t *corners, uint32_t tet_count, struct tetlod_error *error)
{
    uint32_t *neighbours = array_new(4 * (size_t)tet_count, sizeof *neighbours);
    enum tetlod_status status;
    *locator = (struct locator){.positions = positions, .corners = corners, .tet_count = tet_count};
    locator->neighbours = locator->own_neighbours = neighbours;
    if (!neighbours)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the boundary", 16 * (uint64_t)tet_count));
    TETLOD_TRY_DONE(adjacency_build(corners, tet_count, vertex_count, neighbours, NULL, error));
    TETLOD_TRY_DONE(bvh_build(&locator->tets, positions, corners, tet_count, 4, error));
    TETLOD_TRY_DONE(complete(locator, vertex_count, error));
done:
    if (status != TETLOD_OK)
        locator_fini(locator);
    return status;
}

enum tetlod_status locator_init_known(struct locator *locator, const double *positions, uint32_t vertex_count,
                                      const uint32_t *corners, uint32_t tet_count, const uint32_t *neighbours,
                                      uint32_t *order, unsigned threads, struct tetlod_error *error)
{
    *locator = (struct locator){.positions = positions, .corners = corners, .tet_count = tet_count};
    locator->neighbours = neighbours;
    enum tetlod_status status = bvh_build_ordered(&locator->tets, positions, corners, tet_count, 4, order, threads, error);
    if (status == TETLOD_OK)
        status = complete(locator, vertex_count, error);
    if (status != TETLOD_OK)
        locator_fini(locator);
    return status;
}

void locator_fini(struct locator *locator)
{
    free(locator->triangles);
    free(locator->faces);
    free(locator->own_neighbours);
    free(locator->tet_of);
    bvh_fini(&locator->tets);
    bvh_fini(&locator->surface);
    *locator = (struct locator){0};
}

/* Is p a corner of the tetrahedron? */
static bool at_corner(const double *const q[4], const double p[3], double weights[4])
{
    for (int c = 0; c < 4; c++)
        if (p[0] == q[c][0] && p[1] == q[c][1] && p[2] == q[c][2]) {
            weights[0] = weights[1] = weights[2] = weights[3] = 0;
            weights[c] = 1;
            return true;
        }
    return false;
}

double locator_weights(const struct locator *locator, uint32_t tet, const double p[3], double weights[4])
{
    const double *q[4];
    for (int c = 0; c < 4; c++)
        q[c] = locator->positions + 3 * (size_t)locator->corners[4 * (size_t)tet + c];
    double whole = tet_volume6(q[0], q[1], q[2], q[3]), least = INFINITY;
    weights[0] = 1;
    for (int c = 1; c < 4 && whole != 0; c++) {
        const double *r[4] = {q[0], q[1], q[2], q[3]};
        r[c] = p;
        weights[c] = tet_volume6(r[0], r[1], r[2], r[3]) / whole;
        weights[0] -= weights[c];
        least = smaller(least, weights[c]);
    }
    least = whole != 0 ? smaller(least, weights[0]) : -INFINITY;
    // in a thin tetrahedron the rounding of volumes says anything, even of its own corners
    return least < 0 && at_corner(q, p, weights) ? 0 : least;
}

uint32_t locator_find(const struct locator *locator, const double p[3], uint32_t *out_tets, uint32_t most)
{
    const struct bvh *bvh = &locator->tets;
    uint32_t stack[BVH_DEPTH], depth = 0, found = 0;
    double weights[4];
    stack[depth++] = 0;
    while (depth && found < most) {
        uint32_t node = stack[--depth];
        if (bvh_box_distance2(bvh, node, p) > 0)
            continue;
        if (node < bvh->leaf_first) {
            stack[depth++] = 2 * node + 2;
            stack[depth++] = 2 * node + 1;
            continue;
        }
        uint64_t first = (uint64_t)(node - bvh->leaf_first) * BVH_LEAF;
        for (uint64_t i = first; i < bvh->count && i < first + BVH_LEAF && found < most; i++)
            if (locator_weights(locator, bvh->order[i], p, weights) >= ON_FACE)
                out_tets[found++] = bvh->order[i];
    }
    return found;
}

uint32_t locator_walk(const struct locator *locator, uint32_t from, const double p[3], double weights[4])
{
    enum { MOST_STEPS = 64 };
    for (int step = 0; step < MOST_STEPS && from != TETLOD_NONE; step++) {
        if (locator_weights(locator, from, p, weights) >= 0)
            return from;
        int worst = 0;
        for (int c = 1; c < 4; c++)
            if (weights[c] < weights[worst])
                worst = c;
        uint32_t across = locator->neighbours[4 * (size_t)from + (unsigned)worst];
        from = across == TETLOD_NONE ? across : across / 4;
    }
    return TETLOD_NONE;
}

/* ---- closest point */

/* The square of the distance; what is within the square `enough` ends the search. */
static double search(const struct locator *locator, const double p[3], double enough, struct place *out,
                     uint32_t *out_triangle)
{
    const struct bvh *bvh = &locator->surface;
    uint32_t stack[BVH_DEPTH], depth = 0;
    double best = INFINITY, weights[3];
    *out = (struct place){{0}, {0}};
    stack[depth++] = 0;
    while (depth && bvh->count && best > enough) {
        uint32_t node = stack[--depth];
        if (bvh_box_distance2(bvh, node, p) >= best)
            continue;
        if (node < bvh->leaf_first) {
            uint32_t near = 2 * node + 1, far = near + 1;
            if (bvh_box_distance2(bvh, far, p) < bvh_box_distance2(bvh, near, p)) {
                near = far;
                far = near - 1;
            }
            stack[depth++] = far;
            stack[depth++] = near;
            continue;
        }
        uint64_t first = (uint64_t)(node - bvh->leaf_first) * BVH_LEAF;
        for (uint64_t i = first; i < bvh->count && i < first + BVH_LEAF; i++) {
            const uint32_t *triangle = locator->triangles + 3 * (size_t)bvh->order[i];
            double distance2 = triangle_distance2(p, locator->positions + 3 * (size_t)triangle[0],
                                           locator->positions + 3 * (size_t)triangle[1],
                                           locator->positions + 3 * (size_t)triangle[2], weights);
            if (distance2 < best) {
                best = distance2;
                *out_triangle = bvh->order[i];
                for (int c = 0; c < 3; c++) {
                    out->vertices[c] = triangle[c];
                    out->weights[c] = weights[c];
                }
            }
        }
    }
    return best;
}

double locator_closest(const struct locator *locator, const double p[3], struct place *out)
{
    uint32_t triangle;
    return sqrt(search(locator, p, 0, out, &triangle));
}

double locator_distance(const struct locator *locator, const double p[3], double enough, uint32_t *io_face)
{
    struct place place;
    uint32_t triangle = TETLOD_NONE;
    if (*io_face != TETLOD_NONE) {
        const double *q[3];
        for (int i = 0; i < 3; i++)
            q[i] = locator->positions + 3 * (size_t)locator->corners[(*io_face & ~3u) + tet_faces[*io_face & 3][i]];
        double near = sqrt(triangle_distance2(p, q[0], q[1], q[2], place.weights));
        if (near <= enough)
            return near;
    }
    double distance = sqrt(search(locator, p, enough * enough, &place, &triangle));
    *io_face = triangle == TETLOD_NONE ? triangle : locator->faces[triangle];
    return distance;
}
