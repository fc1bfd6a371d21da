/* SPDX-License-Identifier: BSD-3-Clause */
/* Where a simplex may be contracted to (thesis 4.2.2): final vertex positions as weights of its vertices. */
#ifndef TETLOD_CANDIDATES_H
#define TETLOD_CANDIDATES_H

#include "src/simplify/complex.h"

enum { MOST_CANDIDATES = 19, MOST_TRIALS = MOST_CANDIDATES + 1 }; /* one more: a metric's own optimum */

/* How many positions are tried on a simplex of two to four vertices if `wanted` are asked for; 0: the usual number, which is
 * 3 on an edge (ends and midpoint), 4 on a face and 5 on a tetrahedron (vertices and centroid). */
uint32_t candidates_count(uint32_t vertices, uint32_t wanted);

/* The weights of one of them. */
const double *candidates_weights(uint32_t vertices, uint32_t candidate);

/* A candidate's position, as the mesh's type can hold it. At a vertex it is the vertex, bit for bit. */
void candidate_position(const struct complex *complex, const struct star *star, uint32_t candidate, double p[3]);

#endif
