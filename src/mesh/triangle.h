/* SPDX-License-Identifier: BSD-3-Clause */
/* Distances of points from segments and from triangles, which may have no length or no area. */
#ifndef TETLOD_TRIANGLE_H
#define TETLOD_TRIANGLE_H

/* Square of the distance of p from the segment from a to b; out_t: the part of the way to b at the closest point. */
double segment_distance2(const double *p, const double *a, const double *b, double *out_t);

/* Square of the distance of p from the triangle, and the weights of its corners at the closest point. */
double triangle_distance2(const double *p, const double *a, const double *b, const double *c, double weights[3]);

/* The square of the distance of two triangles, 0 if they meet. */
double triangles_distance2(const double *const p[3], const double *const q[3]);

#endif
