/* SPDX-License-Identifier: BSD-3-Clause */
/* What is near a point: partners within the domain error, and distances between boundaries. In doubles, around the
 * point. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/attack/oracle.h"

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* ---- partners */

/* Solves the symmetric system of at most three rows; false where it has no single answer. */
static bool solve(int n, double m[3][3], double b[3])
{
    for (int i = 0; i < n; i++) {
        int best = i;
        for (int r = i; r < n; r++)
            best = fabs(m[r][i]) > fabs(m[best][i]) ? r : best;
        if (!(fabs(m[best][i]) > 0))
            return false;
        for (int c = 0; c < n && best != i; c++) {
            double swap = m[i][c];
            m[i][c] = m[best][c];
            m[best][c] = swap;
        }
        double swap = b[i];
        b[i] = b[best];
        b[best] = swap;
        for (int r = 0; r < n; r++) {
            double by = r == i ? 0 : m[r][i] / m[i][i];
            for (int c = i; c < n; c++)
                m[r][c] -= by * m[i][c];
            b[r] -= by * b[i];
        }
    }
    for (int i = 0; i < n; i++)
        b[i] /= m[i][i];
    return true;
}

/* A face of a tetrahedron of `n` + 1 corners, around the point: corner 0 and edges from it. */
struct flat {
    int n;
    double origin[3], edges[3][3], values[4];
};

/* Weights along the edges of the point of the face's hull that is x plus as little as possible. */
static bool project(const struct flat *f, const double x[3], double w[3])
{
    double m[3][3], r[3];
    for (int d = 0; d < 3; d++)
        r[d] = x[d] - f->origin[d];
    for (int i = 0; i < f->n; i++) {
        w[i] = dot(f->edges[i], r);
        for (int j = 0; j < f->n; j++)
            m[i][j] = dot(f->edges[i], f->edges[j]);
    }
    return solve(f->n, m, w);
}

static bool within(const struct flat *f, const double w[3])
{
    double sum = 0, least = 0;
    for (int i = 0; i < f->n; i++) {
        sum += w[i];
        least = fmin(least, w[i]);
    }
    return least >= -1e-9 && sum <= 1 + 1e-9;
}

/* Extremes of the linear function over the face's inside and the ball around 0: on the ball, in the gradient's
 * direction. */
static void extend_range(const struct flat *f, double radius, double range[2])
{
    static const double zero[3] = {0, 0, 0};
    double w[3] = {0}, foot[3], gradient[3] = {0}, slope[3] = {0}, m[3][3];
    if (!project(f, zero, w))
        return;
    for (int d = 0; d < 3; d++) {
        foot[d] = f->origin[d];
        for (int i = 0; i < f->n; i++)
            foot[d] += w[i] * f->edges[i][d];
    }
    double room = radius * radius - dot(foot, foot);
    if (room < 0)
        return;
    for (int i = 0; i < f->n; i++) {
        slope[i] = f->values[i + 1] - f->values[0];
        for (int j = 0; j < f->n; j++)
            m[i][j] = dot(f->edges[i], f->edges[j]);
    }
    if (f->n && !solve(f->n, m, slope))
        return;
    for (int i = 0; i < f->n; i++)
        for (int d = 0; d < 3; d++)
            gradient[d] += slope[i] * f->edges[i][d];
    double length = sqrt(dot(gradient, gradient));
    for (int sign = -1; sign <= 1; sign++) {
        double at[3], u[3] = {0}, value = f->values[0];
        for (int d = 0; d < 3; d++)
            at[d] = foot[d] + (length > 0 ? sign * sqrt(room) * gradient[d] / length : 0);
        if (!project(f, at, u) || !within(f, u))
            continue;
        for (int i = 0; i < f->n; i++)
            value += u[i] * (f->values[i + 1] - f->values[0]);
        range[0] = fmin(range[0], value);
        range[1] = fmax(range[1], value);
    }
}

static void tet_range(const double corners[4][3], const double values[4], double radius, double range[2])
{
    for (int set = 1; set < 16; set++) {
        struct flat f = {.n = -1};
        for (int c = 0; c < 4; c++) {
            if (!(set >> c & 1))
                continue;
            f.n++;
            f.values[f.n] = values[c];
            for (int d = 0; d < 3; d++)
                if (f.n == 0)
                    f.origin[d] = corners[c][d];
                else
                    f.edges[f.n - 1][d] = corners[c][d] - f.origin[d];
        }
        extend_range(&f, radius, range);
    }
}

double oracle_least_near(const struct oracle_mesh *level, uint32_t part, const double point[3], double radius,
                         uint32_t i,
                         quad value, double enough)
{
    double least = INFINITY;
    for (uint32_t t = 0; t < level->tets && least > enough; t++) {
        const struct oracle_tet *tet = &level->details[t];
        const uint32_t *c = level->corners + 4 * (size_t)t;
        double corners[4][3], values[4], range[2] = {INFINITY, -INFINITY};
        bool far = level->part[c[0]] != part;
        for (int d = 0; d < 3; d++)
            far |= tet->low[d] - point[d] > radius || point[d] - tet->high[d] > radius;
        if (far)
            continue;
        for (int k = 0; k < 4; k++) {
            values[k] = (double)(level->values[i][(size_t)c[k] * level->strides[i]] - value);
            for (int d = 0; d < 3; d++)
                corners[k][d] = level->positions[3 * (size_t)c[k] + (size_t)d] - point[d];
        }
        tet_range((const double(*)[3])corners, values, radius, range);
        least = fmin(least, fmax(0, fmax(range[0], -range[1])));
    }
    return least;
}

bool oracle_partner(const struct oracle_mesh *level, uint32_t part, const double point[3], double radius, uint32_t i,
                    double value, double within_this)
{
    return oracle_least_near(level, part, point, radius, i, value, within_this) <= within_this;
}

/* ---- boundaries */

static double segment_distance(const double p[3], const double a[3], const double b[3])
{
    double e[3], r[3], sum = 0;
    for (int d = 0; d < 3; d++) {
        e[d] = b[d] - a[d];
        r[d] = p[d] - a[d];
    }
    double length = dot(e, e), t = length > 0 ? fmin(1, fmax(0, dot(r, e) / length)) : 0;
    for (int d = 0; d < 3; d++)
        sum += (r[d] - t * e[d]) * (r[d] - t * e[d]);
    return sqrt(sum);
}

/* The distance from the face's plane where the foot is in the face, else INFINITY. Faces may be thin: doubles are not
 * enough. */
static double face_distance(const double p[3], const double corners[3][3])
{
    long double e[3][3], r[3], n[3], c[3], size = 0, height = 0;
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++)
            e[i][d] = (long double)corners[(i + 1) % 3][d] - corners[i][d];
    for (int d = 0; d < 3; d++) {
        n[d] = e[0][(d + 1) % 3] * e[1][(d + 2) % 3] - e[0][(d + 2) % 3] * e[1][(d + 1) % 3];
        size += n[d] * n[d];
        height += n[d] * ((long double)p[d] - corners[0][d]);
    }
    for (int i = 0; i < 3; i++) {
        long double side = 0;
        for (int d = 0; d < 3; d++)
            r[d] = (long double)p[d] - corners[i][d];
        for (int d = 0; d < 3; d++) {
            c[d] = e[i][(d + 1) % 3] * r[(d + 2) % 3] - e[i][(d + 2) % 3] * r[(d + 1) % 3];
            side += n[d] * c[d];
        }
        if (!(side >= 0 && size > 0))
            return INFINITY;
    }
    return (double)(fabsl(height) / sqrtl(size));
}

static double triangle_distance(const double p[3], const double corners[3][3])
{
    double best = INFINITY;
    for (int i = 0; i < 3; i++)
        best = fmin(best, segment_distance(p, corners[i], corners[(i + 1) % 3]));
    double inside = face_distance(p, corners);
    return fmin(best, inside);
}

/* Faces of one tetrahedron only. */
static struct oracle_face *boundary_faces(const struct oracle_mesh *mesh, size_t *out_count)
{
    struct oracle_face *faces = oracle_faces(mesh);
    size_t count = 4 * (size_t)mesh->tets, kept = 0;
    for (size_t i = 0; i < count; i++)
        if (!(i && oracle_same_face(&faces[i], &faces[i - 1])) &&
            !(i + 1 < count && oracle_same_face(&faces[i], &faces[i + 1])))
            faces[kept++] = faces[i];
    *out_count = kept;
    return faces;
}

/* Corners relative to a point near them. */
static void around(const struct oracle_mesh *mesh, const struct oracle_face *face, const double origin[3],
                   double out[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++)
            out[i][d] = mesh->positions[3 * (size_t)face->v[i] + (size_t)d] - origin[d];
}

static double distance_from(const struct oracle_mesh *b, const struct oracle_face *faces, size_t count, uint32_t part,
                            const double origin[3], const double p[3], double enough)
{
    double best = INFINITY, corners[3][3];
    for (size_t i = 0; i < count && best > enough; i++) {
        if (b->part[faces[i].v[0]] != part)
            continue;
        around(b, &faces[i], origin, corners);
        best = fmin(best, triangle_distance(p, (const double(*)[3])corners));
    }
    return best;
}

double oracle_boundary_distance(const struct oracle_mesh *a, const struct oracle_mesh *b)
{
    static const double places[][3] = {{1, 0, 0},       {0, 1, 0},       {0, 0, 1},       {0.5, 0.5, 0}, {0.5, 0, 0.5},
                                       {0, 0.5, 0.5},
                                       {1. / 3, 1. / 3, 1. / 3}, {0.6, 0.2, 0.2}, {0.2, 0.6, 0.2}, {0.2, 0.2, 0.6}};
    size_t counts[2];
    struct oracle_face *faces = boundary_faces(a, &counts[0]), *others = boundary_faces(b, &counts[1]);
    double worst = 0;
    for (size_t i = 0; i < counts[0]; i++) {
        const double *origin = a->positions + 3 * (size_t)faces[i].v[0];
        double corners[3][3];
        around(a, &faces[i], origin, corners);
        for (size_t k = 0; k < sizeof places / sizeof *places; k++) {
            double p[3];
            for (int d = 0; d < 3; d++)
                p[d] = places[k][0] * corners[0][d] + places[k][1] * corners[1][d] + places[k][2] * corners[2][d];
            worst = fmax(worst, distance_from(b, others, counts[1], a->part[faces[i].v[0]], origin, p, worst));
        }
    }
    free(faces);
    free(others);
    return worst;
}
