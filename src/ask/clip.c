/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/clip.h"

#include <math.h>
#include <string.h>

struct clipping {
    const double (*functions)[4];
    unsigned count;
    clip_visit *visit;
    void *opaque;
};

static void clip_from(const struct clipping *clipping, unsigned at, const double piece[4][4]);

/* Where the function is 0 between a corner inside and one outside. */
static void cut(const double inside[4], double value_inside, const double outside[4], double value_outside,
                double out[4])
{
    double t = value_inside / (value_inside - value_outside);
    for (int i = 0; i < 4; i++)
        out[i] = inside[i] + t * (outside[i] - inside[i]);
}

/* A prism between the triangles p and q is three tetrahedra. */
static void clip_prism(const struct clipping *clipping, unsigned at, const double p[3][4], const double q[3][4])
{
    const double *const rows[3][4] = {{p[0], p[1], p[2], q[0]}, {p[1], p[2], q[0], q[1]}, {p[2], q[0], q[1], q[2]}};
    for (int t = 0; t < 3; t++) {
        double piece[4][4];
        for (int i = 0; i < 4; i++)
            memcpy(piece[i], rows[t][i], sizeof piece[i]);
        clip_from(clipping, at, piece);
    }
}

/* One, two or three corners are inside: a tetrahedron, or a prism. `order` has those that are inside first. */
static void clip_part(const struct clipping *clipping, unsigned at, const double piece[4][4], const double values[4],
                      const int order[4], int inside)
{
    double p[3][4], q[3][4], small[4][4];
    if (inside == 1) {
        memcpy(small[0], piece[order[0]], sizeof small[0]);
        for (int i = 1; i < 4; i++)
            cut(piece[order[0]], values[order[0]], piece[order[i]], values[order[i]], small[i]);
        clip_from(clipping, at, small);
        return;
    }
    for (int i = 0; i < inside; i++) {
        double (*corner)[4] = inside == 3 ? &p[i] : i == 0 ? &p[0] : &q[0];
        memcpy(*corner, piece[order[i]], sizeof *corner);
    }
    for (int i = 0; i < inside; i++)
        for (int o = inside; o < 4; o++)
            cut(piece[order[i]], values[order[i]], piece[order[o]], values[order[o]],
                inside == 3 ? q[i] : i == 0 ? p[o - 1] : q[o - 1]);
    clip_prism(clipping, at, p, q);
}

static void clip_from(const struct clipping *clipping, unsigned at, const double piece[4][4])
{
    for (; at < clipping->count; at++) {
        double values[4];
        int order[4], inside = 0, outside = 4, below = 0;
        for (int i = 0; i < 4; i++) {
            values[i] = 0;
            for (int c = 0; c < 4; c++)
                values[i] += piece[i][c] * clipping->functions[at][c];
            below += values[i] < 0;
            if (values[i] > 0)
                order[inside++] = i;
            else
                order[--outside] = i;
        }
        if (!below)
            continue;
        if (inside)
            clip_part(clipping, at + 1, piece, values, order, inside);
        return;
    }
    clipping->visit(clipping->opaque, piece);
}

void clip_tet(const double functions[][4], unsigned count, clip_visit *visit, void *opaque)
{
    static const double whole[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    const struct clipping clipping = {functions, count, visit, opaque};
    clip_from(&clipping, 0, whole);
}

double clip_share(const double piece[4][4])
{
    double d[3][3];
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++)
            d[i][c] = piece[i + 1][c] - piece[0][c];
    return fabs(d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) - d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]));
}
