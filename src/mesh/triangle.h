/* SPDX-License-Identifier: BSD-3-Clause */
/* Distance of a point from a triangle, which may have no area. */
#ifndef TETLOD_TRIANGLE_H
#define TETLOD_TRIANGLE_H

/* Square of the distance of p from the triangle, and the weights of its corners at the closest point. */
double triangle_distance2(const double *p, const double *a, const double *b, const double *c, double weights[3]);

/* The square of the distance of two triangles, 0 if they meet. */
double triangles_distance2(const double *const p[3], const double *const q[3]);

#endif
