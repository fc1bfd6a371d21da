/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/cut.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

void cut_fini(struct cut *surface)
{
    free(surface->ends);
    free(surface->along);
    free(surface->triangles);
    *surface = (struct cut){0};
}

static bool add_vertex(struct cut *surface, uint32_t a, uint32_t b, double along, uint32_t *out)
{
    size_t count = (size_t)surface->vertex_count + 1;
    if (!array_reserve((void **)&surface->ends, &surface->vertex_cap, count, 2 * sizeof *surface->ends) ||
        !array_reserve((void **)&surface->along, &surface->along_cap, count, sizeof *surface->along))
        return false;
    *out = surface->vertex_count++;
    surface->ends[2 * (size_t)*out] = a;
    surface->ends[2 * (size_t)*out + 1] = b;
    surface->along[*out] = along;
    return true;
}

/* A triangle of fewer than three different vertices is none. */
static bool add_triangle(struct cut *surface, uint32_t a, uint32_t b, uint32_t c)
{
    if (a == b || b == c || a == c)
        return true;
    size_t count = (size_t)surface->triangle_count + 1;
    if (!array_reserve((void **)&surface->triangles, &surface->triangle_cap, count, 3 * sizeof *surface->triangles))
        return false;
    uint32_t *triangle = surface->triangles + 3 * (size_t)surface->triangle_count++;
    triangle[0] = a;
    triangle[1] = b;
    triangle[2] = c;
    return true;
}

static int orientation(const struct tetmesh *mesh, const uint32_t *corners)
{
    const double *p = mesh->positions;
    double volume6 = tet_volume6(p + 3 * (size_t)corners[0], p + 3 * (size_t)corners[1], p + 3 * (size_t)corners[2],
                                 p + 3 * (size_t)corners[3]);
    return volume6 < 0 ? -1 : 1;
}

/* ---- the boundary ---- */

static bool add_faces(const struct tetmesh *mesh, const uint32_t *neighbours, uint32_t *numbers, struct cut *out)
{
    for (size_t i = 0; i < (size_t)mesh->tet_count * 4; i++) {
        const uint32_t *corners = mesh->corners + (i & ~(size_t)3);
        uint32_t ids[3];
        if (neighbours[i] != TETLOD_NONE)
            continue;
        for (int c = 0; c < 3; c++) {
            uint32_t vertex = corners[tet_faces[i & 3][c]];
            if (numbers[vertex] == TETLOD_NONE && !add_vertex(out, vertex, vertex, 0, &numbers[vertex]))
                return false;
            ids[c] = numbers[vertex];
        }
        bool inverted = orientation(mesh, corners) < 0;
        if (!add_triangle(out, ids[0], ids[inverted ? 2 : 1], ids[inverted ? 1 : 2]))
            return false;
    }
    return true;
}

enum tetlod_status cut_boundary(const struct tetmesh *mesh, struct cut *out, struct tetlod_error *error)
{
    *out = (struct cut){0};
    uint32_t *neighbours = array_new(mesh->tet_count, 4 * sizeof *neighbours);
    uint32_t *numbers = array_new(mesh->vertex_count, sizeof *numbers);
    enum tetlod_status status = TETLOD_OK;
    if (!neighbours || !numbers)
        status = tetlodi_fail_nomem(error, "a surface", 16 * (uint64_t)mesh->tet_count);
    if (status == TETLOD_OK)
        status = adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL, error);
    if (status == TETLOD_OK) {
        for (uint32_t v = 0; v < mesh->vertex_count; v++)
            numbers[v] = TETLOD_NONE;
        if (!add_faces(mesh, neighbours, numbers, out))
            status = tetlodi_fail_nomem(error, "a surface", 12 * (uint64_t)out->triangle_count);
    }
    free(neighbours);
    free(numbers);
    if (status != TETLOD_OK)
        cut_fini(out);
    return status;
}

/* ---- zero sets ---- */

/* Which vertex of the surface an edge of the mesh holds: open addressing, at most half full. */
struct edges {
    uint64_t *keys; /* smaller end << 32 | larger end; NO_EDGE is free */
    uint32_t *vertices;
    size_t size, count;
};

#define NO_EDGE UINT64_MAX

static size_t slot_of(const struct edges *edges, uint64_t key)
{
    size_t slot = (size_t)((key * 0x9e3779b97f4a7c15u) >> 32) & (edges->size - 1);
    while (edges->keys[slot] != NO_EDGE && edges->keys[slot] != key)
        slot = (slot + 1) & (edges->size - 1);
    return slot;
}

static bool grow(struct edges *edges)
{
    struct edges larger = {.size = edges->size ? 2 * edges->size : 1024, .count = edges->count};
    larger.keys = array_new(larger.size, sizeof *larger.keys);
    larger.vertices = array_new(larger.size, sizeof *larger.vertices);
    if (!larger.keys || !larger.vertices) {
        free(larger.keys);
        free(larger.vertices);
        return false;
    }
    for (size_t i = 0; i < larger.size; i++)
        larger.keys[i] = NO_EDGE;
    for (size_t i = 0; i < edges->size; i++)
        if (edges->keys[i] != NO_EDGE) {
            size_t slot = slot_of(&larger, edges->keys[i]);
            larger.keys[slot] = edges->keys[i];
            larger.vertices[slot] = edges->vertices[i];
        }
    free(edges->keys);
    free(edges->vertices);
    *edges = larger;
    return true;
}

/* The surface's vertex on the edge from a (negative) to b (not negative). Where b is zero it is b itself. */
static bool edge_vertex(struct edges *edges, const double *values, uint32_t a, uint32_t b, struct cut *out,
                        uint32_t *out_vertex)
{
    if (values[b] == 0)
        a = b;
    uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
    if (2 * (edges->count + 1) > edges->size && !grow(edges))
        return false;
    size_t slot = slot_of(edges, key);
    if (edges->keys[slot] == NO_EDGE) {
        double along = a == b ? 0 : values[a] / (values[a] - values[b]);
        if (!add_vertex(out, a, b, along, &edges->vertices[slot]))
            return false;
        edges->keys[slot] = key;
        edges->count++;
    }
    *out_vertex = edges->vertices[slot];
    return true;
}

/* The part of the zero set in one tetrahedron: a triangle if one corner is alone on its side, a quadrilateral if two are. */
static bool cut_tet(const struct tetmesh *mesh, const double *values, const uint32_t *corners, struct edges *edges,
                    struct cut *out)
{
    uint32_t below[4], above[4], order[4], v[4];
    int low = 0, high = 0;
    for (int c = 0; c < 4; c++)
        if (values[corners[c]] < 0)
            below[low++] = corners[c];
        else
            above[high++] = corners[c];
    if (!low || !high)
        return true;
    for (int c = 0; c < 4; c++)
        order[c] = c < low ? below[c] : above[c - low];
    bool flip = orientation(mesh, order) < 0;
    if (low == 2) { // around the quadrilateral: 0-2, 0-3, 1-3, 1-2
        if (!edge_vertex(edges, values, order[0], order[2], out, &v[0]) ||
            !edge_vertex(edges, values, order[0], order[3], out, &v[1]) ||
            !edge_vertex(edges, values, order[1], order[3], out, &v[2]) ||
            !edge_vertex(edges, values, order[1], order[2], out, &v[3]))
            return false;
        return add_triangle(out, v[0], v[flip ? 2 : 1], v[flip ? 1 : 2]) &&
               add_triangle(out, v[0], v[flip ? 3 : 2], v[flip ? 2 : 3]);
    }
    for (int i = 0; i < 3; i++)
        if (!edge_vertex(edges, values, low == 1 ? order[0] : order[i], low == 1 ? order[i + 1] : order[3], out, &v[i]))
            return false;
    return add_triangle(out, v[0], v[flip ? 2 : 1], v[flip ? 1 : 2]);
}

enum tetlod_status cut_zero(const struct tetmesh *mesh, const double *values, struct cut *out,
                            struct tetlod_error *error)
{
    struct edges edges = {0};
    bool made = true;
    *out = (struct cut){0};
    for (size_t t = 0; made && t < mesh->tet_count; t++)
        made = cut_tet(mesh, values, mesh->corners + 4 * t, &edges, out);
    free(edges.keys);
    free(edges.vertices);
    if (made)
        return TETLOD_OK;
    cut_fini(out);
    return tetlodi_fail_nomem(error, "a surface", 0);
}
