/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The intersection of two tetrahedra in arithmetic of 113 bits: for the few pairs on which a verdict hangs. Positions
 * are doubles, so that even tetrahedra that are almost flat are located to more digits than a double has.
 */
#ifndef TETLOD_EXACT_CELL_H
#define TETLOD_EXACT_CELL_H

#include <stdbool.h>
#include <stdint.h>

#include "src/util/quad.h"

enum { EXACT_MAX_ENDS = 24 };

/* Barycentric weights in a tetrahedron of some volume: weights[1 + i](x) = rows[i] . (x - origin). */
struct exact_map {
    const double *origin;
    quad rows[3][3];
};

struct exact_cell {
    const double *corners[2][4]; /* set by the caller */
    struct exact_map maps[2];
    int count;
    quad ends[EXACT_MAX_ENDS][3]; /* of the clipped edges: the intersection's corners, each once, are among them */
    quad middle[3];
};

void exact_map_set(struct exact_map *map, const double *const corners[4]);
void exact_weights(const struct exact_map *map, const quad x[3], quad weights[4]);

/* False: they touch at most: the middle of the intersection is less than 1e-9 inside one of them, by a weight. */
bool exact_cell_clip(struct exact_cell *cell);

/* The difference of two linear functions at an end: values[m] are those at the corners of tetrahedron m. */
quad exact_cell_difference(const struct exact_cell *cell, int end, const double values[2][4]);

/* The same with another tetrahedron in the second one's place. Returned is on which sides of the end, of `count`, that
 * one is: bit k is set if it holds the place a hair inside the intersection, towards half way between its middle and
 * end k. */
uint32_t exact_cell_other(const struct exact_cell *cell, int end, const double *const corners[4],
                          const double values[2][4], quad *out);

/* The square of the distance of p from a triangle, which may have no area. */
double exact_triangle_distance2(const double p[3], const double *const corners[3]);

#endif
