/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/sample_points.h"

#include <string.h>

#include "src/mesh/tet_geom.h"

static uint64_t mix(uint64_t x) // splitmix64's finaliser
{
    x += 0x9e3779b97f4a7c15ull;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ x >> 27) * 0x94d049bb133111ebull;
    return x ^ x >> 31;
}

/* A number that depends on a position only, -0 being 0. */
static uint64_t position_hash(const double p[3])
{
    const double plain[3] = {p[0] + 0.0, p[1] + 0.0, p[2] + 0.0};
    uint64_t bits[3];
    memcpy(bits, plain, sizeof bits);
    return mix(bits[0] + 0x9e3779b97f4a7c15ull * bits[1] + 0xc2b2ae3d27d4eb4full * bits[2]);
}

void sample_weights(const struct tetmesh *mesh, const uint32_t corners[4], unsigned which, double weights[4])
{
    uint64_t hashes[4], sum = 0;
    double total = 0;
    for (int i = 0; i < 4; i++)
        weights[i] = 0.25;
    if (!which)
        return;
    for (int i = 0; i < 4; i++)
        sum += hashes[i] = position_hash(mesh->positions + 3 * (size_t)corners[i]);
    for (int i = 0; i < 4; i++)
        total += weights[i] = (double)((mix(hashes[i] + mix(sum)) >> 11) + 1);
    for (int i = 0; i < 4; i++)
        weights[i] /= total;
}

void sample_place(const struct tetmesh *mesh, size_t sample, struct place *out)
{
    *out = (struct place){{0}, {0}};
    if (sample < mesh->vertex_count) {
        out->vertices[0] = (uint32_t)sample;
        out->weights[0] = 1;
        return;
    }
    size_t k = sample - mesh->vertex_count;
    memcpy(out->vertices, mesh->corners + 4 * (k / SAMPLES_PER_TET), sizeof out->vertices);
    sample_weights(mesh, out->vertices, k % SAMPLES_PER_TET, out->weights);
}

bool sample_tet_is_degenerate(const struct tetmesh *mesh, size_t tet)
{
    const double *p[4];
    for (int c = 0; c < 4; c++)
        p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * tet + (size_t)c];
    return tet_orientation(p[0], p[1], p[2], p[3]) == 0;
}
