/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/triangle.h"

#include <math.h>
#include <stdbool.h>

#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"

double segment_distance2(const double *p, const double *a, const double *b, double *out_t)
{
    double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, e[3] = {p[0] - a[0], p[1] - a[1], p[2] - a[2]};
    double length2 = dot(d, d), sum = 0;
    const double t = length2 > 0 ? smaller(1, larger(0, dot(d, e) / length2)) : 0;
    for (int i = 0; i < 3; i++)
        sum += (e[i] - t * d[i]) * (e[i] - t * d[i]);
    *out_t = t;
    return sum;
}

double triangle_distance2(const double *p, const double *a, const double *b, const double *c, double weights[3])
{
    const double *corner[4] = {a, b, c, a};
    double best = INFINITY, t, u[3], v[3], w[3], n[3];
    for (int i = 0; i < 3; i++) {
        double distance2 = segment_distance2(p, corner[i], corner[i + 1], &t);
        if (distance2 < best) {
            best = distance2;
            weights[0] = weights[1] = weights[2] = 0;
            weights[i] = 1 - t;
            weights[(i + 1) % 3] += t;
        }
    }
    for (int i = 0; i < 3; i++) {
        u[i] = b[i] - a[i];
        v[i] = c[i] - a[i];
        w[i] = p[i] - a[i];
    }
    cross(u, v, n);
    double area2 = dot(n, n);
    if (area2 == 0)
        return best;
    double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v);
    double s = (vv * wu - uv * wv) / area2, r = (uu * wv - uv * wu) / area2, height = dot(n, w);
    if (s < 0 || r < 0 || s + r > 1 || height * height / area2 > best)
        return best;
    weights[0] = 1 - s - r;
    weights[1] = s;
    weights[2] = r;
    return height * height / area2;
}

/* The square of the distance of two segments. */
static double segments_distance2(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3], t, best;
    subtract(b, a, u);
    subtract(d, c, v);
    subtract(a, c, w);
    double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w), area2 = uu * vv - uv * uv;
    best = smaller(smaller(segment_distance2(a, c, d, &t), segment_distance2(b, c, d, &t)),
                   smaller(segment_distance2(c, a, b, &t), segment_distance2(d, a, b, &t)));
    double r = uv * vw - vv * uw, s = uu * vw - uv * uw;
    if (!(area2 > 0) || r < 0 || r > area2 || s < 0 || s > area2)
        return best;
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double x = w[i] + r / area2 * u[i] - s / area2 * v[i];
        sum += x * x;
    }
    return smaller(best, sum);
}

/* Does the segment from a to b cross the triangle? */
static bool crosses(const double *a, const double *b, const double *const q[3])
{
    double n[3], r[3], x[3], weights[3], scale = 0;
    triangle_cross(q[0], q[1], q[2], n);
    subtract(a, q[0], r);
    double from = dot(n, r);
    subtract(b, q[0], r);
    double to = dot(n, r);
    if (!((from <= 0 && to >= 0) || (from >= 0 && to <= 0)) || from == to)
        return false;
    for (int i = 0; i < 3; i++) {
        x[i] = a[i] + from / (from - to) * (b[i] - a[i]);
        scale = larger(scale, fabs(b[i] - a[i]));
    }
    return triangle_distance2(x, q[0], q[1], q[2], weights) <= 1e-24 * scale * scale;
}

double triangles_distance2(const double *const p[3], const double *const q[3])
{
    double best = INFINITY, weights[3];
    for (int i = 0; i < 3; i++) {
        if (crosses(p[i], p[(i + 1) % 3], q) || crosses(q[i], q[(i + 1) % 3], p))
            return 0;
        best = smaller(best, smaller(triangle_distance2(p[i], q[0], q[1], q[2], weights),
                                     triangle_distance2(q[i], p[0], p[1], p[2], weights)));
        for (int k = 0; k < 3; k++)
            best = smaller(best, segments_distance2(p[i], p[(i + 1) % 3], q[k], q[(k + 1) % 3]));
    }
    return best;
}
