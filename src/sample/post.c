/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Flow along +x past a post between two plates, half of it, cut in its plane of symmetry y = 0. i runs around the post
 * from the stagnation line to the wake, j away from it, k from plate to plate. Layers at the post and at the plates are
 * thin: cells are stretched up to 1 : 300 and each layer is 1.18 (size 64) times as thick as the one below it, as in
 * meshes for boundary layers. The fields are formulas: the flow without friction, boundary layers, a separated shear
 * layer, vortices in the wake.
 */
#include <math.h>

#include "format/fail.h"
#include "src/mesh/cell_split.h"
#include "src/sample/make.h"

static const double reach = 12, height = 4; // in radii of the post

/* 0..1 in `count` steps, each longer than the one before it by 1 + growth / count. */
static void graded(double *out, uint32_t count, double growth)
{
    double step = 1, sum = 0;
    for (uint32_t i = 0; i <= count; i++, step *= 1 + growth / count) {
        out[i] = sum;
        sum += step;
    }
    for (uint32_t i = 0; i <= count; i++)
        out[i] /= out[count];
}

struct flow {
    double pressure, velocity[3];
};

static struct flow flow_at(const double p[3])
{
    double square = p[0] * p[0] + p[1] * p[1], r = sqrt(square), from_post = r - 1;
    double from_plate = p[2] < height - p[2] ? p[2] : height - p[2];
    double at_post = from_post / sqrt(from_post * from_post + 0.0004),
           at_plate = from_plate / sqrt(from_plate * from_plate + 0.001);
    double behind = sample_step((p[0] - 0.2) / 0.3), shear = (p[1] - 1 - 0.08 * p[0]) / (0.05 + 0.03 *
                                                                                         (p[0] > 0 ? p[0] : 0));
    double wake = behind * (1 - sample_step(shear)) / (1 + p[0] * p[0] / 60), vortices = 0, turned[2] = {0, 0};
    for (int i = 0; i < 4; i++) {
        double x = p[0] - 1.8 - 2.1 * i, y = p[1] - 0.7 - 0.12 * i, d = x * x + y * y;
        double strength = 0.9 / (1 + d / (0.12 + 0.05 * i)) * (0.8 + 0.2 * at_plate);
        vortices += strength;
        turned[0] -= 1.5 * strength * y;
        turned[1] += 1.5 * strength * x;
    }
    double u = 1 - (p[0] * p[0] - p[1] * p[1]) / (square * square), v = -2 * p[0] * p[1] / (square * square);
    struct flow flow;
    flow.pressure = 0.5 * (1 - (u * u + v * v)) * (1 - 0.8 * behind) - 0.4 * vortices - 0.25 * wake + 0.05 * at_plate;
    flow.velocity[0] = (u * (1 - 1.15 * wake) + turned[0]) * at_post * at_plate;
    flow.velocity[1] = (v * (1 - 0.9 * wake) + turned[1]) * at_post * at_plate;
    flow.velocity[2] = 0.2 * vortices * (p[2] - height / 2) / height * at_plate * at_post;
    return flow;
}

static void fill(struct tetmesh *mesh, const uint32_t dims[3], const double *outwards, const double *upwards)
{
    size_t v = 0;
    for (uint32_t k = 0; k < dims[2]; k++)
        for (uint32_t j = 0; j < dims[1]; j++)
            for (uint32_t i = 0; i < dims[0]; i++, v++) {
                double *p = mesh->positions + 3 * v, cosine, sine, r = 1 + reach * outwards[j];
                sample_turn(0.5 - 0.5 * i / (dims[0] - 1.0), &cosine, &sine);
                p[0] = r * cosine;
                p[1] = i && i + 1 < dims[0] ? r * sine : 0;
                p[2] = 2 * k < dims[2] ? height / 2 * upwards[k] : height - height / 2 * upwards[dims[2] - 1 - k];
                struct flow flow = flow_at(p);
                mesh->fields[0].values[v] = flow.pressure;
                for (int c = 0; c < 3; c++)
                    mesh->fields[1].values[3 * v + (size_t)c] = flow.velocity[c];
            }
}

enum tetlod_status sample_make_post(struct tetmesh *out, uint32_t size, struct tetlod_error *error)
{
    const uint32_t across = size * 3 / 4, half = size / 4, dims[3] = {size + 1, across + 1, 2 * half + 1};
    double outwards[512], upwards[512]; // of the greatest size
    TETLOD_TRY(sample_alloc_flow(out, dims, error));
    graded(outwards, across, 8.5);
    graded(upwards, half, 5.5);
    fill(out, dims, outwards, upwards);
    sample_round(out);
    grid_split(dims, out->positions, out->corners);
    out->tet_count = (uint32_t)grid_tet_count(dims);
    return TETLOD_OK;
}
