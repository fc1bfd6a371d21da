/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Geometry of one tetrahedron. Corners 0..3; face f is opposite corner f; edge e joins the corners tet_edges[e].
 *
 *        3
 *       /|\        6V = (p1 - p0) . ((p2 - p0) x (p3 - p0)) > 0 as drawn,
 *      / | \       3 above the plane of 0, 1, 2 seen counter-clockwise.
 *     0--|--2
 *      \ | /
 *        1
 */
#ifndef TETLOD_TET_GEOM_H
#define TETLOD_TET_GEOM_H

#include <math.h>
#include <stdint.h>

/* A tetrahedron is degenerate if |6V| is at most this times the cube of its longest edge: its interpolant is noise. */
#define TET_DEGENERATE 1e-9

static const uint8_t tet_edges[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* Corners of face f, counter-clockwise seen from outside a positive tetrahedron. */
static const uint8_t tet_faces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

/* Ascending, as a face is looked for whichever tetrahedron shows it. */
static inline void sort_three(uint32_t v[3])
{
    for (int last = 2; last > 0; last--)
        for (int i = 0; i < last; i++)
            if (v[i] > v[i + 1]) {
                uint32_t larger_one = v[i];
                v[i] = v[i + 1];
                v[i + 1] = larger_one;
            }
}

/* Two vertices as one number, whichever comes first: the less one is above. */
static inline uint64_t pair_key(uint32_t x, uint32_t y)
{
    return x < y ? (uint64_t)x << 32 | y : (uint64_t)y << 32 | x;
}

/* A tetrahedron's corners, ascending. */
static inline void sort_corners(const uint32_t corners[4], uint32_t out[4])
{
    for (int c = 0; c < 4; c++) {
        int at = c;
        for (; at && out[at - 1] > corners[c]; at--)
            out[at] = out[at - 1];
        out[at] = corners[c];
    }
}

/* Comparisons, not fmin and fmax: those are calls, because they treat NaN specially. */
static inline double smaller(double a, double b)
{
    return a < b ? a : b;
}

static inline double larger(double a, double b)
{
    return a > b ? a : b;
}

static inline double tet_volume6(const double *p0, const double *p1, const double *p2, const double *p3)
{
    double ax = p1[0] - p0[0], ay = p1[1] - p0[1], az = p1[2] - p0[2];
    double bx = p2[0] - p0[0], by = p2[1] - p0[1], bz = p2[2] - p0[2];
    double cx = p3[0] - p0[0], cy = p3[1] - p0[1], cz = p3[2] - p0[2];
    return ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
}

static inline double distance_squared(const double *p, const double *q)
{
    double x = q[0] - p[0], y = q[1] - p[1], z = q[2] - p[2];
    return x * x + y * y + z * z;
}

/* Square of the longest edge. */
static inline double tet_size_squared(const double *p0, const double *p1, const double *p2, const double *p3)
{
    return larger(larger(larger(distance_squared(p0, p1), distance_squared(p0, p2)),
                         larger(distance_squared(p0, p3), distance_squared(p1, p2))),
                  larger(distance_squared(p1, p3), distance_squared(p2, p3)));
}

/* +1, -1, or 0 for a degenerate tetrahedron. */
static inline int tet_orientation(const double *p0, const double *p1, const double *p2, const double *p3)
{
    double volume6 = tet_volume6(p0, p1, p2, p3), size2 = tet_size_squared(p0, p1, p2, p3);
    if (!(fabs(volume6) > TET_DEGENERATE * size2 * sqrt(size2)))
        return 0;
    return volume6 > 0 ? 1 : -1;
}

#endif
