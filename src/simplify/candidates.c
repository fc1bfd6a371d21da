/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/candidates.h"

/* Vertices first: a position that is already there is the cheapest to store. On an edge its middle and fifths follow. */
static const double on_edge[7][4] = {{1, 0},     {0, 1},     {0.5, 0.5}, {0.8, 0.2},
                                     {0.2, 0.8}, {0.6, 0.4}, {0.4, 0.6}};

static const double third = 1.0 / 3;

/* Vertices, centroid, midpoints of the edges. */
static const double on_face[7][4] = {{1, 0, 0},     {0, 1, 0},     {0, 0, 1},    {third, third, third},
                                     {0.5, 0.5, 0}, {0.5, 0, 0.5}, {0, 0.5, 0.5}};

/* Vertices, centroid, midpoints of edges and faces, centroids of the corner tetrahedra that the edges' midpoints cut off. */
static const double on_tet[MOST_CANDIDATES][4] = {{1, 0, 0, 0},
                                                  {0, 1, 0, 0},
                                                  {0, 0, 1, 0},
                                                  {0, 0, 0, 1},
                                                  {0.25, 0.25, 0.25, 0.25},
                                                  {0.5, 0.5, 0, 0},
                                                  {0.5, 0, 0.5, 0},
                                                  {0.5, 0, 0, 0.5},
                                                  {0, 0.5, 0.5, 0},
                                                  {0, 0.5, 0, 0.5},
                                                  {0, 0, 0.5, 0.5},
                                                  {0, third, third, third},
                                                  {third, 0, third, third},
                                                  {third, third, 0, third},
                                                  {third, third, third, 0},
                                                  {0.625, 0.125, 0.125, 0.125},
                                                  {0.125, 0.625, 0.125, 0.125},
                                                  {0.125, 0.125, 0.625, 0.125},
                                                  {0.125, 0.125, 0.125, 0.625}};

uint32_t candidates_count(uint32_t vertices, uint32_t wanted)
{
    static const uint32_t usual[3] = {3, 4, 5}, most[3] = {7, 7, MOST_CANDIDATES};
    if (!wanted)
        return usual[vertices - 2];
    return wanted < most[vertices - 2] ? wanted : most[vertices - 2];
}

const double *candidates_weights(uint32_t vertices, uint32_t candidate)
{
    return vertices == 2 ? on_edge[candidate] : vertices == 3 ? on_face[candidate] : on_tet[candidate];
}

void candidate_position(const struct complex *complex, const struct star *star, uint32_t candidate, double p[3])
{
    const double *weights = candidates_weights(star->simplex_count, candidate);
    const double *first = complex->positions + 3 * (size_t)star->simplex[0];
    p[0] = p[1] = p[2] = 0;
    for (uint32_t s = 0; s < star->simplex_count; s++) {
        const double *at = complex->positions + 3 * (size_t)star->simplex[s];
        for (int i = 0; i < 3; i++)
            p[i] = weights[s] == 1 ? at[i] : p[i] + weights[s] * (at[i] - first[i]) + (s ? 0 : first[i]);
        if (weights[s] == 1)
            return;
    }
    complex_round_position(complex, p);
}
