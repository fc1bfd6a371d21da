/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/mesh_surface.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/util/array.h"

/* Of large meshes in files the states are looked at first: they are a sixteenth of the neighbours. */
static bool is_listed(const uint32_t *neighbours, size_t slot, const uint8_t *states, uint8_t least, uint8_t most)
{
    return (!states || (states[slot / 4] >= least && states[slot / 4] <= most)) && neighbours[slot] == TETLOD_NONE;
}

enum tetlod_status mesh_surface_init(struct mesh_surface *surface, const double *positions, const uint32_t *corners,
                                     const uint32_t *neighbours, uint32_t tet_count, const uint8_t *states,
                                     uint8_t least, uint8_t most, struct tetlod_error *error)
{
    size_t slots = 4 * (size_t)tet_count, room = 0, corner_room = 0;
    *surface = (struct mesh_surface){.positions = positions};
    for (size_t s = 0; s < slots; s++) {
        if (!is_listed(neighbours, s, states, least, most))
            continue;
        size_t count = surface->count;
        if (!ARRAY_RESERVE(surface->faces, room, count + 1) ||
            !ARRAY_RESERVE(surface->triangles, corner_room, 3 * (count + 1))) {
            mesh_surface_fini(surface);
            return tetlodi_fail_nomem(error, "the boundary", slots * 4);
        }
        for (size_t i = 0; i < 3; i++)
            surface->triangles[3 * count + i] = corners[(s & ~(size_t)3) + tet_faces[s & 3][i]];
        surface->faces[surface->count++] = (uint32_t)s;
    }
    enum tetlod_status status = bvh_build(&surface->boxes, positions, surface->triangles, surface->count, 3, BVH_LEAF,
                                          error);
    if (status != TETLOD_OK)
        mesh_surface_fini(surface);
    return status;
}

void mesh_surface_fini(struct mesh_surface *surface)
{
    free(surface->triangles);
    free(surface->faces);
    bvh_fini(&surface->boxes);
    *surface = (struct mesh_surface){0};
}

/* The square of the distance; what is within the square `enough` ends the search. */
static double search(const struct mesh_surface *surface, uint32_t body, const double p[3], double enough,
                     struct place *out,
                     uint32_t *out_triangle)
{
    const struct bvh *bvh = &surface->boxes;
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
        uint64_t first = (uint64_t)(node - bvh->leaf_first) * bvh->leaf;
        for (uint64_t i = first; i < bvh->count && i < first + bvh->leaf; i++) {
            const uint32_t *triangle = surface->triangles + 3 * (size_t)bvh->order[i];
            if (surface->bodies && surface->bodies[triangle[0]] != body)
                continue;
            double distance2 = triangle_distance2(p, surface->positions + 3 * (size_t)triangle[0],
                                           surface->positions + 3 * (size_t)triangle[1],
                                           surface->positions + 3 * (size_t)triangle[2], weights);
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

double mesh_surface_closest(const struct mesh_surface *surface, uint32_t body, const double p[3], struct place *out,
                            uint32_t *out_face)
{
    uint32_t triangle = TETLOD_NONE;
    double distance = sqrt(search(surface, body, p, 0, out, &triangle));
    *out_face = triangle == TETLOD_NONE ? triangle : surface->faces[triangle];
    return distance;
}

double mesh_surface_distance(const struct mesh_surface *surface, uint32_t body, const double p[3], double enough,
                             uint32_t *out_face)
{
    struct place place;
    uint32_t triangle = TETLOD_NONE;
    double distance = sqrt(search(surface, body, p, enough * enough, &place, &triangle));
    *out_face = triangle == TETLOD_NONE ? triangle : surface->faces[triangle];
    return distance;
}
