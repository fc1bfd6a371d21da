/* SPDX-License-Identifier: BSD-3-Clause */
/* Vectors of three, in one order of operations: what is decided or stored must not depend on who computes it. */
#ifndef TETLOD_VECTOR_H
#define TETLOD_VECTOR_H

static inline void subtract(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] - b[i];
}

static inline double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* `out` is neither a nor b. */
static inline void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* (q - p) x (r - p): twice the area of the triangle long. */
static inline void triangle_cross(const double *p, const double *q, const double *r, double out[3])
{
    double a[3], b[3];
    subtract(q, p, a);
    subtract(r, p, b);
    cross(a, b, out);
}

#endif
