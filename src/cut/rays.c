/* SPDX-License-Identifier: BSD-3-Clause */
/* The tree halves the faces along a Hilbert curve: its shape follows from their number alone. */
#include "src/cut/rays.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/cut/cut_add.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/hilbert.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

void cut_rays_fini(struct cut_rays *rays)
{
    free(rays->vertices);
    free(rays->neighbours);
    free(rays->faces);
    free(rays->nodes);
    free(rays->of_tets);
    *rays = (struct cut_rays){0};
}

static uint32_t count_faces(const struct cut_rays *rays)
{
    uint32_t count = 0;
    for (size_t slot = 0; slot < 4 * (size_t)rays->tet_count; slot++)
        count += rays->neighbours[slot] == TETLOD_NONE;
    return count;
}

static void list_faces(const struct tetmesh *mesh, const struct cut_rays *rays, uint32_t *slots, double *middles)
{
    size_t count = 0;
    for (uint32_t slot = 0; slot < 4 * rays->tet_count; slot++) {
        if (rays->neighbours[slot] != TETLOD_NONE)
            continue;
        for (int d = 0; d < 3; d++) {
            middles[3 * count + (size_t)d] = 0;
            for (int c = 0; c < 3; c++)
                middles[3 * count + (size_t)d] +=
                    mesh->positions[3 * (size_t)mesh->corners[(slot & ~3u) + tet_faces[slot & 3][c]] + (size_t)d] / 3;
        }
        slots[count++] = slot;
    }
}

static void put_face(const struct tetmesh *mesh, uint32_t slot, uint32_t out[4])
{
    const uint32_t *corners = mesh->corners + (slot & ~3u);
    bool inverted = cut_is_inverted(mesh, corners);
    for (int c = 0; c < 3; c++)
        out[inverted ? 2 - c : c] = corners[tet_faces[slot & 3][c]];
    out[3] = slot;
}

/* Leaves first .. first + count - 1, and what is above them, from node `at` on. Returns the node behind them. */
static uint32_t grow(float *nodes, uint32_t at, uint32_t first, uint32_t count)
{
    float *node = nodes + 8 * (size_t)at;
    uint32_t end = at + 1;
    if (count > 1) {
        end = grow(nodes, end, first, count / 2);
        end = grow(nodes, end, first + count / 2, count - count / 2);
    }
    node[3] = (float)end;
    node[7] = count == 1 ? (float)first : -1;
    return end;
}

static enum tetlod_status plant(const struct tetmesh *mesh, uint32_t count, uint32_t *slots, double *middles,
                                uint32_t *order,
                                struct cut_rays *out, struct tetlod_error *error)
{
    list_faces(mesh, out, slots, middles);
    TETLOD_TRY(hilbert_order(middles, count, order, error));
    for (uint32_t i = 0; i < count; i++)
        put_face(mesh, slots[order[i]], out->faces + 4 * (size_t)i);
    if (out->face_count > count)
        memset(out->faces + 4 * (size_t)count, 0xff, 16 * (size_t)(out->face_count - count));
    out->node_count = out->face_count ? grow(out->nodes, 0, 0, out->face_count / RAYS_LEAF) : 0;
    return TETLOD_OK;
}

static enum tetlod_status find_faces(const struct tetmesh *mesh, struct cut_rays *out, struct tetlod_error *error)
{
    uint32_t count = count_faces(out);
    if (count >= 1u << 24)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "%u faces are more than float32 numbers", count);
    uint32_t *slots = array_new(count, sizeof *slots), *order = array_new(count, sizeof *order);
    double *middles = array_new(count, 3 * sizeof *middles);
    out->face_count = (count + RAYS_LEAF - 1) / RAYS_LEAF * RAYS_LEAF;
    bool room = slots && order && middles &&
                ARRAY_RESERVE(out->faces, out->face_cap, 4 * (size_t)out->face_count) &&
                ARRAY_RESERVE(out->nodes, out->node_cap, 16 * (size_t)out->face_count);
    enum tetlod_status status = room ? plant(mesh, count, slots, middles, order, out, error)
                                     : tetlodi_fail_nomem(error, "the boundary's faces", 64 * (uint64_t)count);
    free(slots);
    free(order);
    free(middles);
    return status;
}

enum tetlod_status cut_rays_connect(const struct tetmesh *mesh, struct cut_rays *out, struct tetlod_error *error)
{
    if (mesh->tet_count > ADJACENCY_MAX_TETS)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "%u tetrahedra are more than the %d that fit", mesh->tet_count,
                            ADJACENCY_MAX_TETS);
    out->tet_count = mesh->tet_count;
    out->corners = mesh->corners;
    if (!ARRAY_RESERVE(out->neighbours, out->neighbour_cap, 4 * (size_t)mesh->tet_count))
        return tetlodi_fail_nomem(error, "neighbours", 16 * (uint64_t)mesh->tet_count);
    TETLOD_TRY(adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, out->neighbours, NULL, error));
    return find_faces(mesh, out, error);
}

static void widen(float *node, const float *low, const float *high)
{
    for (int d = 0; d < 3; d++) {
        node[d] = low[d] < node[d] ? low[d] : node[d];
        node[4 + d] = high[d] > node[4 + d] ? high[d] : node[4 + d];
    }
}

/* Children come behind their parents. */
static void place_boxes(struct cut_rays *rays)
{
    for (uint32_t i = rays->node_count; i-- > 0;) {
        float *node = rays->nodes + 8 * (size_t)i;
        for (int d = 0; d < 3; d++) {
            node[d] = INFINITY;
            node[4 + d] = -INFINITY;
        }
        if (node[7] < 0) {
            const float *first = node + 8, *second = rays->nodes + 8 * (size_t)first[3];
            widen(node, first, first + 4);
            widen(node, second, second + 4);
            continue;
        }
        const uint32_t *faces = rays->faces + 4 * RAYS_LEAF * (size_t)node[7];
        for (int f = 0; f < RAYS_LEAF; f++)
            for (int c = 0; c < 3 && faces[4 * f + 3] != TETLOD_NONE; c++) {
                const float *vertex = rays->vertices + 4 * (size_t)faces[4 * f + c];
                widen(node, vertex, vertex);
            }
    }
}

static bool take_values(const double *of_tets, struct cut_rays *out)
{
    size_t count = ((size_t)out->tet_count + 3) / 4 * 4;
    out->has_of_tets = of_tets != NULL;
    if (of_tets && !ARRAY_RESERVE(out->of_tets, out->of_tets_cap, count))
        return false;
    for (size_t t = 0; of_tets && t < count; t++)
        out->of_tets[t] = t < out->tet_count ? (float)of_tets[t] : 0;
    return true;
}

enum tetlod_status cut_rays_place(const struct tetmesh *mesh, const double *values, const double *of_tets,
                                  const double centre[3],
                                  struct cut_rays *out, struct tetlod_error *error)
{
    if (!take_values(of_tets, out))
        return tetlodi_fail_nomem(error, "values of tetrahedra", 4 * (uint64_t)out->tet_count);
    if (!ARRAY_RESERVE(out->vertices, out->vertex_cap, 4 * (size_t)mesh->vertex_count))
        return tetlodi_fail_nomem(error, "vertices", 16 * (uint64_t)mesh->vertex_count);
    out->vertex_count = mesh->vertex_count;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        for (size_t d = 0; d < 3; d++)
            out->vertices[4 * v + d] = (float)(mesh->positions[3 * v + d] - centre[d]);
        out->vertices[4 * v + 3] = (float)values[v];
    }
    place_boxes(out);
    return TETLOD_OK;
}
