/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/triangle.h"

#include <math.h>

#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"

static double on_segment(const double *p, const double *a, const double *b, double *t)
{
    double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, e[3] = {p[0] - a[0], p[1] - a[1], p[2] - a[2]};
    double length2 = dot(d, d), sum = 0;
    *t = length2 > 0 ? smaller(1, larger(0, dot(d, e) / length2)) : 0;
    for (int i = 0; i < 3; i++)
        sum += (e[i] - *t * d[i]) * (e[i] - *t * d[i]);
    return sum;
}

double triangle_distance2(const double *p, const double *a, const double *b, const double *c, double weights[3])
{
    const double *corner[4] = {a, b, c, a};
    double best = INFINITY, t, u[3], v[3], w[3], n[3];
    for (int i = 0; i < 3; i++) {
        double distance2 = on_segment(p, corner[i], corner[i + 1], &t);
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
