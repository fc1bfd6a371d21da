/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/boundary_surface.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

static const double *point(const struct tetmesh *mesh, uint32_t v)
{
    return mesh->positions + 3 * (size_t)v;
}

static enum tetlod_status find_triangles(const struct tetmesh *mesh, struct boundary_surface *out, struct tetlod_error *error)
{
    size_t slots = 4 * (size_t)mesh->tet_count;
    uint32_t *neighbours = array_new(slots, sizeof *neighbours), count = 0;
    if (!neighbours)
        return tetlodi_fail_nomem(error, "the boundary", slots * sizeof *neighbours);
    enum tetlod_status status =
        adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL, error);
    for (size_t slot = 0; status == TETLOD_OK && slot < slots; slot++)
        count += neighbours[slot] == TETLOD_NONE;
    if (status == TETLOD_OK) {
        out->triangles = array_new(count, sizeof *out->triangles);
        status = out->triangles ? TETLOD_OK : tetlodi_fail_nomem(error, "the boundary", (uint64_t)count * 12);
    }
    for (size_t slot = 0; status == TETLOD_OK && slot < slots; slot++) {
        const uint32_t *c = mesh->corners + (slot & ~(size_t)3);
        if (neighbours[slot] != TETLOD_NONE)
            continue;
        bool turned = tet_volume6(point(mesh, c[0]), point(mesh, c[1]), point(mesh, c[2]), point(mesh, c[3])) < 0;
        for (int i = 0; i < 3; i++)
            out->triangles[out->count][i] = c[tet_faces[slot & 3][turned ? 2 - i : i]];
        out->count++;
    }
    free(neighbours);
    return status;
}

/* Numbers the points of the surface in their order. */
static enum tetlod_status number_points(const struct tetmesh *mesh, struct boundary_surface *out, struct tetlod_error *error)
{
    size_t size = mesh->vertex_count * sizeof *out->numbers;
    out->numbers = array_new(mesh->vertex_count, sizeof *out->numbers);
    if (!out->numbers)
        return tetlodi_fail_nomem(error, "the boundary", size);
    memset(out->numbers, 0xff, size); // TETLOD_NONE
    for (uint32_t t = 0; t < out->count; t++)
        for (int i = 0; i < 3; i++)
            out->numbers[out->triangles[t][i]] = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        if (out->numbers[v] != TETLOD_NONE)
            out->numbers[v] = out->point_count++;
    return TETLOD_OK;
}

enum tetlod_status boundary_surface_find(const struct tetmesh *mesh, struct boundary_surface *out, struct tetlod_error *error)
{
    *out = (struct boundary_surface){0};
    TETLOD_TRY(find_triangles(mesh, out, error));
    return number_points(mesh, out, error);
}

void boundary_surface_fini(struct boundary_surface *surface)
{
    free(surface->triangles);
    free(surface->numbers);
    *surface = (struct boundary_surface){0};
}
