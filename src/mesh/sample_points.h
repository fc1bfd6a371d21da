/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The points at which the error of a level is sampled: every vertex of the original, and in each of its tetrahedra the
 * centroid and a point at random, which follows from the positions of the corners: a mesh is sampled alike in whatever
 * order it lists its vertices, tetrahedra and corners. Samples 0 .. vertices-1 are the vertices; tetrahedron t has
 * SAMPLES_PER_TET more.
 */
#ifndef TETLOD_SAMPLE_POINTS_H
#define TETLOD_SAMPLE_POINTS_H

#include <stddef.h>

#include "src/mesh/mesh_surface.h"
#include "src/mesh/tetmesh.h"

enum { SAMPLES_PER_TET = 2 };

static inline size_t sample_count(const struct tetmesh *mesh)
{
    return mesh->vertex_count + SAMPLES_PER_TET * (size_t)mesh->tet_count;
}

/* A number that depends on a position only. */
uint64_t sample_hash(const double p[3]);

/* Sorts a tetrahedron's corners by their hashes: what is added up in this order has the same bits however a mesh lists
 * them. */
void sample_sort(uint64_t hashes[4], uint32_t corners[4]);

/* Weights of the point at random in a tetrahedron whose corners have these hashes. */
void sample_weights_of_hashes(const uint64_t hashes[4], double weights[4]);

/* Weights of sample `which` < SAMPLES_PER_TET in a tetrahedron. */
void sample_weights(const struct tetmesh *mesh, const uint32_t corners[4], unsigned which, double weights[4]);

/* A sample as a combination of vertices of the original, which are sorted. */
void sample_place(const struct tetmesh *mesh, size_t sample, struct place *out);

/* Has a tetrahedron no interpolant? Then its samples do not count, nor do vertices of such tetrahedra only. */
bool sample_tet_is_degenerate(const struct tetmesh *mesh, size_t tet);

/* The value of a component at a place: `values` has rows of `width`. */
static inline double place_value(const double *values, uint32_t width, uint32_t component, const struct place *place)
{
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += place->weights[i] * values[(size_t)place->vertices[i] * width + component];
    return sum;
}

/* The same less a value: so that rounding is about what varies, not about how far from zero it does. */
static inline double place_rise(const double *values, uint32_t width, uint32_t component, const struct place *place,
                                double base)
{
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += place->weights[i] * (values[(size_t)place->vertices[i] * width + component] - base);
    return sum;
}

#endif
