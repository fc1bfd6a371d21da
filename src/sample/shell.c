/* SPDX-License-Identifier: BSD-3-Clause */
/* A ball with a cavity: layers over a cubed sphere. */
#include <math.h>

#include "src/sample/make.h"
#include "src/sample/layers.h"

static const double cavity = 0.35;

static void place(struct tetmesh *mesh, const struct surface *surface, uint32_t vertex, double radius)
{
    const uint32_t *q = surface->points[vertex % surface->point_count];
    double *p = mesh->positions + 3 * (size_t)vertex, length = 0;
    for (int d = 0; d < 3; d++) {
        double c = 2.0 * q[d] / surface->size - 1;
        p[d] = c * (1.32 - 0.32 * c * c); // evens out the sizes of the cells that the projection makes
        length += p[d] * p[d];
    }
    length = sqrt(length);
    for (int d = 0; d < 3; d++)
        p[d] *= radius / length;
    double spot = (p[0] - 0.6) * (p[0] - 0.6) + (p[1] - 0.5) * (p[1] - 0.5) + p[2] * p[2];
    mesh->fields[0].values[vertex] = cavity / radius + 0.5 / (1 + 8 * spot) + 0.1 * p[2];
}

enum tetlod_status sample_make_shell(struct tetmesh *out, uint32_t size, struct tetlod_error *error)
{
    struct surface surface;
    uint32_t layers = (size + 1) / 2;
    *out = (struct tetmesh){0};
    enum tetlod_status status = surface_init(&surface, size, SIDES_ALL, error);
    if (status == TETLOD_OK)
        status = sample_alloc(out, (uint64_t)surface.point_count * (layers + 1),
                              6 * (uint64_t)surface.quad_count * layers, error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "temperature", 1, TETLOD_FLOAT32, error);
    if (status != TETLOD_OK) {
        surface_fini(&surface);
        tetmesh_fini(out);
        return status;
    }
    for (uint32_t v = 0; v < out->vertex_count; v++)
        place(out, &surface, v, cavity + (1 - cavity) * (v / surface.point_count) / layers);
    sample_round(out);
    for (uint32_t layer = 0; layer < layers; layer++)
        for (uint32_t f = 0; f < surface.quad_count; f++) {
            uint32_t cell[8];
            for (int c = 0; c < 4; c++) {
                cell[c] = surface.quads[f][c] + layer * surface.point_count;
                cell[4 + c] = cell[c] + surface.point_count;
            }
            sample_hexahedron(out, cell);
        }
    surface_fini(&surface);
    return TETLOD_OK;
}
