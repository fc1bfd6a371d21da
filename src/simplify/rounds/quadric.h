/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Quadrics in (x, y, z, s): a sum of weighted squares of affine functions of a position and a value, as 15 numbers: the
 * upper triangle, row by row, of a symmetric matrix over (x, y, z, s, 1). Positions and values are normalised by
 * whoever adds.
 */
#ifndef TETLOD_QUADRIC_H
#define TETLOD_QUADRIC_H

#include <stdbool.h>

enum { QUADRIC_SIZE = 15 };

/* Adds weight * (gradient . p + constant - s)^2: how far s is from a field's interpolant (Cignoni and others 2000). */
void quadric_add_field(double quadric[QUADRIC_SIZE], const double gradient[3], double constant, double weight);

/* Adds weight * the squared distance from the space that a tetrahedron's four points (x, y, z, s) span (Garland and
 * Heckbert 1998, generalised). Nothing if they span less. */
void quadric_add_distance(double quadric[QUADRIC_SIZE], const double points[4][4], double weight);

/* The value that makes the quadric least at p, and that least. 0 at any s: s is left as it is. */
double quadric_least_at(const double quadric[QUADRIC_SIZE], const double p[3], double *s);

/* The sum of the weights of the value: a quadric over it is a mean square difference of values. */
double quadric_weight(const double quadric[QUADRIC_SIZE]);

/* The quadric at (p, s). */
double quadric_at(const double quadric[QUADRIC_SIZE], const double p[3], double s);

/* The position where the quadric is least over positions and values. False: there is no single one. */
bool quadric_optimum(const double quadric[QUADRIC_SIZE], double p[3]);

#endif
