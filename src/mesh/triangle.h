/* SPDX-License-Identifier: BSD-3-Clause */
/* Distance of a point from a triangle, which may have no area. */
#ifndef TETLOD_TRIANGLE_H
#define TETLOD_TRIANGLE_H

/* Square of the distance of p from the triangle, and the weights of its corners at the closest point. */
double triangle_distance2(const double *p, const double *a, const double *b, const double *c, double weights[3]);

#endif
