/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The part of a tetrahedron in which linear functions are not negative: a convex solid. Each corner has three
 * neighbours. A function takes away the corners where it is negative, and each edge that it cuts gets a new one; the
 * new corners are joined along the faces that were there. What is joined to what depends on signs alone, so that
 * rounding moves corners by little, but never opens the solid: a cubic planar graph that no two edges hold together
 * remains one.
 */
#ifndef TETLOD_CLIP_H
#define TETLOD_CLIP_H

#include <stdint.h>

/* A box and a threshold. Two corners of a tetrahedron cut at most four edges, later half of the corners all of them,
 * were rounding to make it so: each function doubles the corners at most. Some of these are left out at once. */
enum { MAX_CLIP_PLANES = 7, MAX_CLIP_CORNERS = 6 << (MAX_CLIP_PLANES - 1) };

struct clipped {
    unsigned count, piece_count;
    double weights[MAX_CLIP_CORNERS * 5 / 4][4]; /* of each corner, for the corners of the clipped tetrahedron */
    uint16_t beside[MAX_CLIP_CORNERS * 5 / 4][3]; /* its neighbours, in the order around it, seen from outside */
    /* tetrahedra of its corners that fill the solid; some may be flat; `share`: of the clipped one's volume */
    uint16_t pieces[2 * MAX_CLIP_CORNERS][4];
    double shares[2 * MAX_CLIP_CORNERS], share;
};

/* The part where all `count` functions are at least 0; functions[k][c] is the value of function k at corner c. Empty:
 * no corners. The same functions give the same pieces, in the same order. clip_tet is both. */
void clip_corners(const double functions[][4], unsigned count, struct clipped *out);
void clip_pieces(struct clipped *out);
void clip_tet(const double functions[][4], unsigned count, struct clipped *out);

static inline double clip_value(const double at[4], const double weights[4])
{
    return weights[0] * at[0] + weights[1] * at[1] + weights[2] * at[2] + weights[3] * at[3];
}

/* The integral over the solid of what has `values` at its corners, for a volume of 1 of the clipped tetrahedron. */
static inline double clip_integral(const struct clipped *part, const double *values)
{
    double sum = 0;
    for (unsigned i = 0; i < part->piece_count; i++) {
        const uint16_t *v = part->pieces[i];
        sum += part->shares[i] * (values[v[0]] + values[v[1]] + values[v[2]] + values[v[3]]) / 4;
    }
    return sum;
}

/* The share of a tetrahedron where a linear function is at most a threshold. `values`: at its corners, rising. */
double clip_share_below(const double values[4], double threshold);
void clip_sort(double values[4]);

#endif
