/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Supersonic flow along +x meets a fin with a round nose that stands on a plate, half of it, cut in its plane of
 * symmetry y = 0. The grid follows the fin: i along it from the stagnation line over the nose and down its flank, j
 * away from it, k up from the plate; cells are small at the fin and at the plate. The fields are formulas that have
 * what makes such flows hard: a detached shock, which stands further off at the plate, a stagnation region, a horseshoe
 * vortex and boundary layers.
 */
#include <math.h>

#include "src/mesh/cell_split.h"
#include "src/sample/make.h"

// lengths in nose radii; share of the cells on the nose
static const double flank_end = 4, height = 4, nose_share = 0.4;

struct place {
    double x, y, z;
    double along[2];  /* unit tangent of the fin here, downstream */
    double from_fin;  /* distance */
};

/* 0..1 to 0..1, finer towards 0 by about 1 : (1 + stretch). */
static double stretched(double u, double stretch)
{
    return u * (1 + stretch * u * u) / (1 + stretch);
}

/* u along the fin, v away from it, w up, each 0..1. */
static struct place locate(double u, double v, double w)
{
    double foot[2], normal[2], angle = u < nose_share ? u / nose_share : 1;
    double flank = u < nose_share ? 0 : (u - nose_share) / (1 - nose_share);
    sample_turn(0.5 - 0.25 * angle, &normal[0], &normal[1]);
    double past = flank_end * flank * (1 + flank) / 2; // the nose
    foot[0] = normal[0] + past;
    foot[1] = normal[1];
    double reach = 3.5 + 2 * angle + past * (0.2 + 0.05 * past); // without a kink at the shoulder
    struct place at = {.along = {normal[1], -normal[0]}, .from_fin = reach * stretched(v, 6)};
    at.x = foot[0] + at.from_fin * normal[0];
    at.y = foot[1] + at.from_fin * normal[1];
    at.z = height * stretched(w, 8);
    return at;
}

struct flow {
    double pressure, density, velocity[3];
};

static struct flow flow_at(const struct place *at)
{
    double stand_off = 1 + 1.3 / (1 + at->z * at->z / 0.6);
    double shock = sample_step((at->x + 1 + stand_off - at->y * at->y / 7) / 0.2); // 0 before it, 1 behind
    double strength = shock / (1 + at->y * at->y / 18);
    double nose = 1 / (1 + ((at->x + 1) * (at->x + 1) + at->y * at->y) / 0.7);
    double shoulder = 1 / (1 + ((at->x - 0.4) * (at->x - 0.4) + (at->y - 1) * (at->y - 1)) / 0.8);
    double core_distance = sqrt((at->x + 1) * (at->x + 1) + at->y * at->y) - 1.1, core_height = at->z - 0.22;
    double vortex = shock / (1 + (core_distance * core_distance + core_height * core_height) / 0.03);
    double at_plate = at->z / sqrt(at->z * at->z + 0.02), at_fin = at->from_fin / sqrt(at->from_fin * at->from_fin +
                                                                                       0.01);
    struct flow flow;
    flow.pressure = 1 + strength * (3.2 + 5.5 * nose - 1.6 * shoulder) - 1.8 * vortex;
    flow.density = (1 + strength * (2.1 + 1.4 * nose - 0.9 * shoulder) - 0.7 * vortex) * (0.55 + 0.45 * at_plate);
    double speed = 2.95 * (1 - 0.55 * strength - 0.35 * nose * shock) * at_plate * at_fin;
    double turned = shock / (1 + at->from_fin * at->from_fin / 2.5); // how far the flow follows the fin
    double direction[2] = {1 - turned + turned * at->along[0], turned * at->along[1]};
    double length = sqrt(direction[0] * direction[0] + direction[1] * direction[1]);
    flow.velocity[0] = speed * direction[0] / length - 4 * vortex * core_height;
    flow.velocity[1] = speed * direction[1] / length;
    flow.velocity[2] = 4 * vortex * core_distance * at_plate;
    return flow;
}

static void fill(struct tetmesh *mesh, const uint32_t dims[3])
{
    size_t v = 0;
    for (uint32_t k = 0; k < dims[2]; k++)
        for (uint32_t j = 0; j < dims[1]; j++)
            for (uint32_t i = 0; i < dims[0]; i++, v++) {
                struct place at = locate(i / (dims[0] - 1.0), j / (dims[1] - 1.0), k / (dims[2] - 1.0));
                struct flow flow = flow_at(&at);
                double *p = mesh->positions + 3 * v, *velocity = mesh->fields[2].values + 3 * v;
                p[0] = at.x;
                p[1] = at.y;
                p[2] = at.z;
                mesh->fields[0].values[v] = flow.pressure;
                mesh->fields[1].values[v] = flow.density;
                for (int c = 0; c < 3; c++)
                    velocity[c] = flow.velocity[c];
            }
}

enum tetlod_status sample_make_fin(struct tetmesh *out, uint32_t size, struct tetlod_error *error)
{
    const uint32_t across = size * 3 / 4, dims[3] = {size + 1, across + 1, across + 1};
    enum tetlod_status status =
        sample_alloc(out, (uint64_t)dims[0] * dims[1] * dims[2], grid_tet_count(dims), error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "Pressure", 1, TETLOD_FLOAT32, error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "Density", 1, TETLOD_FLOAT32, error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "Velocity", 3, TETLOD_FLOAT32, error);
    if (status != TETLOD_OK) {
        tetmesh_fini(out);
        return status;
    }
    fill(out, dims);
    sample_round(out);
    grid_split(dims, out->positions, out->corners);
    out->tet_count = (uint32_t)grid_tet_count(dims);
    return TETLOD_OK;
}
