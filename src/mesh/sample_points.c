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

/* -0 is 0. */
uint64_t sample_hash(const double p[3])
{
    const double plain[3] = {p[0] + 0.0, p[1] + 0.0, p[2] + 0.0};
    uint64_t bits[3];
    memcpy(bits, plain, sizeof bits);
    return mix(bits[0] + 0x9e3779b97f4a7c15ull * bits[1] + 0xc2b2ae3d27d4eb4full * bits[2]);
}

/* Puts two corners in order, without a branch: which comes first is random. Corners whose hashes are equal keep their
 * order. */
static inline void order_two(uint64_t hashes[4], uint32_t places[4], int i, int k)
{
    uint64_t a = hashes[i], b = hashes[k];
    uint32_t x = places[i], y = places[k];
    uint64_t swap = -(uint64_t)((a > b) | ((a == b) & (x > y)));
    hashes[i] = a ^ ((a ^ b) & swap);
    hashes[k] = b ^ ((a ^ b) & swap);
    places[i] = x ^ ((x ^ y) & (uint32_t)swap);
    places[k] = y ^ ((x ^ y) & (uint32_t)swap);
}

void sample_sort(uint64_t hashes[4], uint32_t corners[4])
{
    uint32_t places[4] = {0, 1, 2, 3};
    const uint32_t before[4] = {corners[0], corners[1], corners[2], corners[3]};
    order_two(hashes, places, 0, 1);
    order_two(hashes, places, 2, 3);
    order_two(hashes, places, 0, 2);
    order_two(hashes, places, 1, 3);
    order_two(hashes, places, 1, 2);
    for (int i = 0; i < 4; i++)
        corners[i] = before[places[i]];
}

void sample_weights_of_hashes(const uint64_t hashes[4], double weights[4])
{
    uint64_t sum = hashes[0] + hashes[1] + hashes[2] + hashes[3];
    double total = 0;
    for (int i = 0; i < 4; i++)
        total += weights[i] = (double)(int64_t)((mix(hashes[i] + mix(sum)) >> 11) + 1); // below 2^53
    for (int i = 0; i < 4; i++)
        weights[i] /= total;
}

void sample_weights(const struct tetmesh *mesh, const uint32_t corners[4], unsigned which, double weights[4])
{
    uint64_t hashes[4];
    for (int i = 0; i < 4; i++)
        weights[i] = 0.25;
    for (int i = 0; i < 4 && which; i++)
        hashes[i] = sample_hash(mesh->positions + 3 * (size_t)corners[i]);
    if (which)
        sample_weights_of_hashes(hashes, weights);
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
    uint64_t hashes[4];
    memcpy(out->vertices, mesh->corners + 4 * (k / SAMPLES_PER_TET), sizeof out->vertices);
    for (int i = 0; i < 4; i++)
        hashes[i] = sample_hash(mesh->positions + 3 * (size_t)out->vertices[i]);
    sample_sort(hashes, out->vertices);
    sample_weights(mesh, out->vertices, k % SAMPLES_PER_TET, out->weights);
}

bool sample_tet_is_degenerate(const struct tetmesh *mesh, size_t tet)
{
    const double *p[4];
    for (int c = 0; c < 4; c++)
        p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * tet + (size_t)c];
    return tet_orientation(p[0], p[1], p[2], p[3]) == 0;
}
