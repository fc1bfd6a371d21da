/* SPDX-License-Identifier: BSD-3-Clause */
/* The unit cube, graded towards its corner at the origin: a small cube of lattice cells there, and around it layers of
 * cells that all have the same shape, each larger than the one inside it by 1 + 1/N. */
#include <math.h>

#include "src/sample/make.h"
#include "src/sample/layers.h"

static const double core_most = 5e-5; // the core's side; the largest cells are near 1/N, the core's below this / N

static void place(struct tetmesh *mesh, uint32_t vertex, const uint32_t q[3], double scale)
{
    double *p = mesh->positions + 3 * (size_t)vertex, square = 0;
    for (int d = 0; d < 3; d++) {
        p[d] = q[d] * scale;
        square += p[d] * p[d];
    }
    double tilt = square > 0 ? p[0] * p[1] / square : 0;
    mesh->fields[0].values[vertex] = sqrt(sqrt(sqrt(square))) * (1 + 0.5 * tilt); // r^(1/4): all scales count
}

static void add_core(struct tetmesh *mesh, uint32_t size)
{
    uint32_t row = size + 1, slab = row * row;
    for (uint32_t k = 0; k < size; k++)
        for (uint32_t j = 0; j < size; j++)
            for (uint32_t i = 0; i < size; i++) {
                uint32_t a = i + row * j + slab * k, b = a + slab;
                sample_hexahedron(mesh, (uint32_t[8]){a, a + 1, a + row + 1, a + row, b, b + 1, b + row + 1, b + row});
            }
}

/* Vertex of a surface point in a layer; layer 0 is the surface of the core. */
static uint32_t vertex_of(const struct surface *s, uint32_t layer, uint32_t point)
{
    uint32_t row = s->size + 1;
    const uint32_t *q = s->points[point];
    return layer == 0 ? q[0] + row * (q[1] + row * q[2]) : row * row * row + (layer - 1) * s->point_count + point;
}

static void place_all(struct tetmesh *mesh, const struct surface *s, uint32_t layers, double core)
{
    uint32_t row = s->size + 1, q[3], vertex = 0;
    for (q[2] = 0; q[2] < row; q[2]++)
        for (q[1] = 0; q[1] < row; q[1]++)
            for (q[0] = 0; q[0] < row; q[0]++)
                place(mesh, vertex++, q, core / s->size);
    double side = core;
    for (uint32_t layer = 1; layer <= layers; layer++) {
        side = layer == layers ? 1 : side * (1 + 1.0 / s->size);
        for (uint32_t p = 0; p < s->point_count; p++)
            place(mesh, vertex_of(s, layer, p), s->points[p], side / s->size);
    }
}

enum tetlod_status sample_make_delta(struct tetmesh *out, uint32_t size, struct tetlod_error *error)
{
    struct surface surface;
    uint32_t layers = 0, row = size + 1;
    double core = 1;
    while (core > core_most) {
        core /= 1 + 1.0 / size;
        layers++;
    }
    *out = (struct tetmesh){0};
    enum tetlod_status status = surface_init(&surface, size, SIDES_FAR, error);
    if (status == TETLOD_OK)
        status = sample_alloc(out, (uint64_t)row * row * row + (uint64_t)layers * surface.point_count,
                              6 * ((uint64_t)size * size * size + (uint64_t)layers * surface.quad_count), error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "potential", 1, TETLOD_FLOAT32, error);
    if (status != TETLOD_OK) {
        surface_fini(&surface);
        tetmesh_fini(out);
        return status;
    }
    place_all(out, &surface, layers, core);
    sample_round(out);
    add_core(out, size);
    for (uint32_t layer = 0; layer < layers; layer++)
        for (uint32_t f = 0; f < surface.quad_count; f++) {
            uint32_t cell[8];
            for (int c = 0; c < 4; c++) {
                cell[c] = vertex_of(&surface, layer, surface.quads[f][c]);
                cell[4 + c] = vertex_of(&surface, layer + 1, surface.quads[f][c]);
            }
            sample_hexahedron(out, cell);
        }
    surface_fini(&surface);
    return TETLOD_OK;
}
