/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The wake of a post while a shock runs over it: a series in time on one mesh. The channel begins right behind the
 * post; i runs along +x, j across, k up; cells are smaller near the post and in the middle. Vortices are shed on
 * alternate sides, travel downstream and widen; the shock, a leaning front, enters at the inlet and leaves at the
 * outlet. The fields are formulas of position and time, 0 <= time <= 1.
 */
#include <math.h>

#include "format/fail.h"
#include "src/mesh/cell_split.h"
#include "src/sample/make.h"

enum { VORTICES = 7 };
static const double length = 12, half_width = 3, height = 2, spacing = 2.2; // in diameters of the post

struct flow {
    double pressure, velocity[3];
};

/* Where vortex `number` is at that time: one is shed with each unit of `travelled`. */
static void add_vortex(struct flow *flow, const double p[3], int number, double time)
{
    double travelled = number - 2 + 3 * time, x = spacing * travelled, side = number % 2 ? 1 : -1;
    double dx = p[0] - x - 0.15 * p[2], dy = p[1] - side * (0.45 + 0.03 * x);
    double core = 0.4 + 0.04 * (x > 0 ? x : 0), strength = sample_step(2 * travelled) / (1 + 0.03 * x * x);
    double swirl = strength / (1 + (dx * dx + dy * dy) / core);
    flow->pressure -= 0.55 * swirl;
    flow->velocity[0] += side * 1.6 * swirl * dy;
    flow->velocity[1] -= side * 1.6 * swirl * dx;
    flow->velocity[2] += 0.12 * swirl * (p[2] - height / 2);
}

static struct flow flow_at(const double p[3], double time)
{
    double deficit = 1 / (1 + p[1] * p[1] / (0.35 + 0.06 * p[0])) / (1 + 0.12 * p[0]);
    double at_floor = p[2] / sqrt(p[2] * p[2] + 0.03);
    double front = -1 + (length + 3) * time - 0.12 * p[1] * p[1] + 0.3 * p[2];
    double behind = sample_step((front - p[0]) / 0.5);
    struct flow flow = {1 - 0.3 * deficit, {(1 - 0.7 * deficit), 0, 0}};
    for (int i = 0; i < VORTICES; i++)
        add_vortex(&flow, p, i, time);
    flow.pressure = flow.pressure * (1 + 0.25 * behind) + 0.9 * behind;
    flow.velocity[0] = (flow.velocity[0] + 0.6 * behind) * at_floor;
    flow.velocity[1] *= at_floor;
    return flow;
}

void sample_move_wake(struct tetmesh *mesh, double time)
{
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        struct flow flow = flow_at(mesh->positions + 3 * v, time);
        mesh->fields[0].values[v] = flow.pressure;
        for (size_t c = 0; c < 3; c++)
            mesh->fields[1].values[3 * v + c] = flow.velocity[c];
    }
    sample_round(mesh);
}

static void place(struct tetmesh *mesh, const uint32_t dims[3])
{
    size_t v = 0;
    for (uint32_t k = 0; k < dims[2]; k++)
        for (uint32_t j = 0; j < dims[1]; j++)
            for (uint32_t i = 0; i < dims[0]; i++, v++) {
                double along = i / (dims[0] - 1.0), across = 2 * j / (dims[1] - 1.0) - 1, up = k / (dims[2] - 1.0);
                double *p = mesh->positions + 3 * v;
                p[0] = 0.5 + length * along * (0.5 + 0.5 * along);
                p[1] = half_width * across * (0.45 + 0.55 * across * across) * (1 + 0.2 * along);
                p[2] = height * up * (0.6 + 0.4 * up);
            }
    sample_round(mesh);
}

enum tetlod_status sample_make_wake(struct tetmesh *out, uint32_t size, struct tetlod_error *error)
{
    const uint32_t dims[3] = {2 * size + 1, size + 1, size / 2 + 1};
    TETLOD_TRY(sample_alloc_flow(out, dims, error));
    place(out, dims);
    sample_move_wake(out, 0);
    grid_split(dims, out->positions, out->corners);
    out->tet_count = (uint32_t)grid_tet_count(dims);
    return TETLOD_OK;
}
