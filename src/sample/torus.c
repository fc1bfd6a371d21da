/* SPDX-License-Identifier: BSD-3-Clause */
/* A ring: a square of cells bent into a disc, carried around the z axis. */
#include <math.h>

#include "src/sample/make.h"

static const double ring = 2, thickness = 0.8;

/* A square with rounded sides: halfway to the disc, so that no corner of a cell opens to a straight angle. */
static void across(double u, double v, double *out_u, double *out_v)
{
    *out_u = u * sqrt(1 - 0.35 * v * v);
    *out_v = v * sqrt(1 - 0.35 * u * u);
}

static void place(struct tetmesh *mesh, uint32_t vertex, double u, double v, double turn)
{
    double cosine, sine, *p = mesh->positions + 3 * (size_t)vertex;
    across(u, v, &u, &v);
    sample_turn(turn, &cosine, &sine);
    p[0] = (ring + thickness * u) * cosine;
    p[1] = (ring + thickness * u) * sine;
    p[2] = thickness * v;
    double hot = (p[0] - 1.6) * (p[0] - 1.6) + (p[1] - 1.2) * (p[1] - 1.2) + (p[2] - 0.3) * (p[2] - 0.3);
    double cold = (p[0] + 2.2) * (p[0] + 2.2) + p[1] * p[1] + p[2] * p[2];
    mesh->fields[0].values[vertex] = 20 + 80 / (1 + 4 * hot) - 15 / (1 + 2 * cold);
}

enum tetlod_status sample_make_torus(struct tetmesh *out, uint32_t size, struct tetlod_error *error)
{
    uint32_t around = 6 * size + 2, row = size + 1, slab = row * row;
    enum tetlod_status status =
        sample_alloc(out, (uint64_t)slab * around, 6 * (uint64_t)size * size * around, error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "temperature", 1, TETLOD_FLOAT32, error);
    if (status != TETLOD_OK) {
        tetmesh_fini(out);
        return status;
    }
    for (uint32_t k = 0; k < around; k++)
        for (uint32_t j = 0; j < row; j++)
            for (uint32_t i = 0; i < row; i++)
                place(out, i + row * j + slab * k, 2.0 * i / size - 1, 2.0 * j / size - 1, (double)k / around);
    sample_round(out);
    for (uint32_t k = 0; k < around; k++)
        for (uint32_t j = 0; j < size; j++)
            for (uint32_t i = 0; i < size; i++) {
                uint32_t a = i + row * j + slab * k, b = i + row * j + slab * ((k + 1) % around);
                sample_hexahedron(out, (uint32_t[8]){a, a + 1, a + row + 1, a + row, b, b + 1, b + row + 1, b + row});
            }
    return TETLOD_OK;
}
