/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/sample/sample.h"

#include <math.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/cell_split.h"
#include "src/sample/make.h"
#include "src/util/array.h"

const struct sample samples[] = {
    {"cube", "N x N x N unit cubes of six tetrahedra, field xyz = x y z (N = 20: 48,000 tetrahedra)", 20, 1, 500,
     sample_make_cube, NULL},
    {"fin", "flow around a blunt fin on a plate: bow shock, Pressure, Density, Velocity; N cells along the fin", 24, 4,
     400, sample_make_fin, NULL},
    {"post", "flow past a post between plates, cells stretched up to 1 : 300 in thin layers; Pressure, Velocity; N "
             "cells around it", 24,
     4, 400, sample_make_post, NULL},
    {"torus", "a ring, which has a handle; field temperature; N cells across", 8, 1, 200, sample_make_torus, NULL},
    {"shell", "a ball with a cavity; field temperature; N cells along an edge of the cubed sphere", 10, 2, 300,
     sample_make_shell, NULL},
    {"delta", "a cube graded towards one corner, cell sizes over 1 : 10,000; field potential; N cells a side", 6, 1,
     100,
     sample_make_delta, NULL},
    {"wake", "a shock runs over the wake of a post: a series with --steps; Pressure, Velocity; N cells across", 16, 4,
     200,
     sample_make_wake, sample_move_wake},
    {0},
};

const struct sample *sample_find(const char *name)
{
    for (const struct sample *s = samples; s->name; s++)
        if (strcmp(s->name, name) == 0)
            return s;
    return NULL;
}

enum tetlod_status sample_alloc(struct tetmesh *out, uint64_t vertices, uint64_t tets, struct tetlod_error *error)
{
    *out = (struct tetmesh){.position_type = TETLOD_FLOAT32};
    if (vertices >= TETLOD_NONE || tets > ADJACENCY_MAX_TETS)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT, "a sample of %llu tetrahedra does not fit; ask for a smaller size",
                            (unsigned long long)tets);
    out->positions = array_zero(vertices, 3 * sizeof *out->positions);
    out->corners = array_zero(tets, 4 * sizeof *out->corners);
    if (!out->positions || !out->corners) {
        tetmesh_fini(out);
        return tetlodi_fail_nomem(error, "the sample", vertices * 24 + tets * 16);
    }
    out->vertex_count = (uint32_t)vertices;
    return TETLOD_OK;
}

enum tetlod_status sample_alloc_flow(struct tetmesh *out, const uint32_t dims[3], struct tetlod_error *error)
{
    enum tetlod_status status = sample_alloc(out, (uint64_t)dims[0] * dims[1] * dims[2], grid_tet_count(dims), error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "Pressure", 1, TETLOD_FLOAT32, error);
    if (status == TETLOD_OK)
        status = tetmesh_add_field(out, "Velocity", 3, TETLOD_FLOAT32, error);
    if (status != TETLOD_OK)
        tetmesh_fini(out);
    return status;
}

static void round_all(double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        values[i] = (double)(float)values[i];
}

void sample_round(struct tetmesh *mesh)
{
    round_all(mesh->positions, 3 * (size_t)mesh->vertex_count);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        round_all(mesh->fields[f].values, (size_t)mesh->fields[f].components * mesh->vertex_count);
}

void sample_hexahedron(struct tetmesh *mesh, const uint32_t corners[8])
{
    uint32_t tets[CELL_MAX_TETS][4];
    unsigned count = cell_split(CELL_HEXAHEDRON, corners, mesh->positions, tets);
    memcpy(mesh->corners + 4 * (size_t)mesh->tet_count, tets, count * sizeof *tets);
    mesh->tet_count += count;
}

void sample_turn(double fraction, double *cosine, double *sine)
{
    int quarter = (int)(4 * fraction + 0.5);
    double angle = (fraction - quarter * 0.25) * 6.283185307179586, square = angle * angle;
    double c = 1, s = 1; // nested Taylor series; |angle| <= pi/4, the first term left out is below 1e-19
    for (int n = 9; n > 0; n--) {
        c = 1 - square / ((2 * n - 1) * (2 * n)) * c;
        s = 1 - square / ((2 * n) * (2 * n + 1)) * s;
    }
    s *= angle;
    *cosine = (quarter & 1 ? -s : c) * (quarter & 2 ? -1 : 1);
    *sine = (quarter & 1 ? c : s) * (quarter & 2 ? -1 : 1);
}

double sample_step(double x)
{
    return 0.5 + 0.5 * x / sqrt(1 + x * x);
}
