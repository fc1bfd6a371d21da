/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Delaunay tetrahedra by insertion (Bowyer, Watson), for some hundred random points. Each point removes the tetrahedra
 * whose circumsphere holds it, and joins the faces of that cavity. Signs are taken in long double; random points need
 * no more.
 */
#include <stdlib.h>

#include "tests/attack/shapes.h"

typedef long double real;

struct cloud {
    real p[SHAPE_MAX_VERTICES + 4][3];
    uint32_t tets[SHAPE_MAX_TETS][4];
    bool dead[SHAPE_MAX_TETS];
    uint32_t count, faces[4 * SHAPE_MAX_TETS][3], face_count;
};

static real det3(const real a[3], const real b[3], const real c[3])
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

static void from(real out[4], const real a[3], const real origin[3])
{
    out[3] = 0;
    for (int d = 0; d < 3; d++) {
        out[d] = a[d] - origin[d];
        out[3] += out[d] * out[d];
    }
}

static real volume(const struct cloud *c, const uint32_t t[4])
{
    real e[3][4];
    for (int i = 0; i < 3; i++)
        from(e[i], c->p[t[i + 1]], c->p[t[0]]);
    return det3(e[0], e[1], e[2]);
}

/* Is x inside the circumsphere of the positive tetrahedron t? */
static bool in_sphere(const struct cloud *c, const uint32_t t[4], uint32_t x)
{
    real e[4][4];
    for (int i = 0; i < 4; i++)
        from(e[i], c->p[t[i]], c->p[x]);
    return e[0][3] * det3(e[1], e[2], e[3]) - e[1][3] * det3(e[0], e[2], e[3]) + e[2][3] * det3(e[0], e[1], e[3]) -
               e[3][3] * det3(e[0], e[1], e[2]) > 0;
}

/* A face of the cavity seen from two removed tetrahedra is inside of it, and goes again. */
static void toggle_face(struct cloud *c, uint32_t a, uint32_t b, uint32_t d)
{
    for (uint32_t f = 0; f < c->face_count; f++) {
        uint32_t *g = c->faces[f];
        int same = 0;
        for (int i = 0; i < 3; i++)
            same += g[i] == a || g[i] == b || g[i] == d;
        if (same == 3) {
            for (int i = 0; i < 3; i++)
                g[i] = c->faces[c->face_count - 1][i];
            c->face_count--;
            return;
        }
    }
    uint32_t *g = c->faces[c->face_count++];
    g[0] = a, g[1] = b, g[2] = d;
}

static void insert(struct cloud *c, uint32_t x)
{
    static const int sides[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    c->face_count = 0;
    uint32_t kept = 0;
    for (uint32_t t = 0; t < c->count; t++) {
        bool dies = in_sphere(c, c->tets[t], x);
        for (int s = 0; s < 4 && dies; s++)
            toggle_face(c, c->tets[t][sides[s][0]], c->tets[t][sides[s][1]], c->tets[t][sides[s][2]]);
        for (int i = 0; i < 4 && !dies; i++)
            c->tets[kept][i] = c->tets[t][i];
        kept += !dies;
    }
    c->count = kept;
    for (uint32_t f = 0; f < c->face_count; f++) {
        uint32_t t[4] = {x, c->faces[f][0], c->faces[f][1], c->faces[f][2]};
        if (volume(c, t) < 0) {
            t[1] = c->faces[f][1];
            t[2] = c->faces[f][0];
        }
        if (volume(c, t) > 0 && c->count < SHAPE_MAX_TETS) {
            for (int i = 0; i < 4; i++)
                c->tets[c->count][i] = t[i];
            c->count++;
        }
    }
}

void shape_delaunay(struct shape *shape, uint32_t first)
{
    static const double around[4][3] = {{-90, -110, -100}, {310, -95, -105}, {-105, 320, -95}, {-95, -105, 300}};
    struct cloud *c = calloc(1, sizeof *c);
    uint32_t n = shape->vertices - first;
    if (!c)
        exit(2);
    for (uint32_t v = 0; v < n + 4; v++)
        for (int d = 0; d < 3; d++)
            c->p[v][d] = v < n ? shape->positions[3 * (first + v) + (uint32_t)d] : around[v - n][d];
    for (uint32_t i = 0; i < 4; i++)
        c->tets[0][i] = n + i;
    c->count = 1;
    if (volume(c, c->tets[0]) < 0) {
        c->tets[0][1] = n;
        c->tets[0][0] = n + 1;
    }
    for (uint32_t v = 0; v < n; v++)
        insert(c, v);
    for (uint32_t t = 0; t < c->count && shape->tets < SHAPE_MAX_TETS; t++) {
        const uint32_t *at = c->tets[t];
        if (at[0] < n && at[1] < n && at[2] < n && at[3] < n) {
            for (int i = 0; i < 4; i++)
                shape->corners[4 * shape->tets + (uint32_t)i] = first + at[i];
            shape->tets++;
        }
    }
    free(c);
}
