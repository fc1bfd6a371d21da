/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/ask/clip.h"

#include <math.h>
#include <string.h>

/* Where a way around a face goes on. */
static unsigned next_slot(const struct clipped *solid, unsigned from, unsigned corner)
{
    const uint16_t *beside = solid->beside[corner];
    return beside[0] == from ? 1 : 2 * (unsigned)(beside[1] == from);
}

/* New corners, between those inside and those outside. */
static void cut_edges(struct clipped *solid, unsigned old, const double *values)
{
    for (unsigned v = 0; v < old; v++)
        for (unsigned s = 0; s < 3 && values[v] >= 0; s++) {
            const unsigned other = solid->beside[v][s];
            if (other >= old || values[other] >= 0)
                continue;
            double *out = solid->weights[solid->count], t = values[v] / (values[v] - values[other]);
            for (int i = 0; i < 4; i++)
                out[i] = solid->weights[v][i] + t * (solid->weights[other][i] - solid->weights[v][i]);
            solid->beside[v][s] = (uint16_t)solid->count;
            solid->beside[solid->count++][0] = (uint16_t)v;
        }
}

/* Joins each new corner to the one that comes before it around the old face. */
static void join(struct clipped *solid, unsigned old)
{
    for (unsigned n = old; n < solid->count; n++) {
        unsigned from = n, at = solid->beside[n][0];
        while (at < old) {
            unsigned next = solid->beside[at][next_slot(solid, from, at)];
            from = at;
            at = next;
        }
        solid->beside[n][2] = (uint16_t)at;
        solid->beside[at][1] = (uint16_t)n;
    }
}

/* Leaves out the corners where the function was negative. */
static void compact(struct clipped *solid, unsigned old, const double *values)
{
    uint16_t numbers[MAX_CLIP_CORNERS * 5 / 4];
    unsigned count = 0;
    for (unsigned v = 0; v < solid->count; v++) {
        if (v < old && values[v] < 0)
            continue;
        numbers[v] = (uint16_t)count;
        memcpy(solid->weights[count], solid->weights[v], sizeof solid->weights[v]);
        memcpy(solid->beside[count++], solid->beside[v], sizeof solid->beside[v]);
    }
    solid->count = count;
    for (unsigned v = 0; v < count; v++)
        for (int s = 0; s < 3; s++)
            solid->beside[v][s] = numbers[solid->beside[v][s]];
}

static void cut(struct clipped *solid, const double function[4])
{
    const unsigned old = solid->count;
    double values[MAX_CLIP_CORNERS];
    unsigned inside = 0, outside = 0;
    for (unsigned v = 0; v < old; v++) {
        values[v] = clip_value(function, solid->weights[v]);
        inside += values[v] > 0;
        outside += values[v] < 0;
    }
    if (!outside)
        return;
    if (!inside) {
        solid->count = 0;
        return;
    }
    cut_edges(solid, old, values);
    join(solid, old);
    compact(solid, old, values);
}

/* ---- pieces */

static double share_of(const double (*weights)[4], const uint16_t piece[4])
{
    double d[3][3];
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++)
            d[i][c] = weights[piece[i + 1]][c] - weights[piece[0]][c];
    return fabs(d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) - d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
                d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]));
}

/* Goes around a face. Each of its triangles forms a piece with corner 0, unless that is a corner of the face: the faces
 * of corner 0 come first. */
static void add_face(struct clipped *solid, unsigned first, unsigned slot, uint8_t *visited)
{
    unsigned from = first, at = solid->beside[first][slot];
    visited[first] |= (uint8_t)(1 << slot);
    while (at != first) {
        const unsigned on = next_slot(solid, from, at);
        visited[at] |= (uint8_t)(1 << on);
        if (first && from != first) {
            const uint16_t piece[4] = {0, (uint16_t)first, (uint16_t)from, (uint16_t)at};
            const double share = share_of((const double(*)[4])solid->weights, piece);
            memcpy(solid->pieces[solid->piece_count], piece, sizeof piece);
            solid->shares[solid->piece_count++] = share;
            solid->share += share;
        }
        from = at;
        at = solid->beside[at][on];
    }
}

void clip_corners(const double functions[][4], unsigned count, struct clipped *out)
{
    static const double weights[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    static const uint16_t beside[4][3] = {{1, 3, 2}, {2, 3, 0}, {0, 3, 1}, {1, 2, 0}};
    out->count = 4;
    memcpy(out->weights, weights, sizeof weights);
    memcpy(out->beside, beside, sizeof beside);
    for (unsigned k = 0; k < count && out->count; k++)
        cut(out, functions[k]);
}

void clip_pieces(struct clipped *out)
{
    uint8_t visited[MAX_CLIP_CORNERS];
    out->piece_count = 0;
    out->share = 0;
    memset(visited, 0, out->count);
    for (unsigned v = 0; v < out->count; v++)
        for (unsigned s = 0; s < 3; s++)
            if (!(visited[v] >> s & 1))
                add_face(out, v, s, visited);
}

void clip_tet(const double functions[][4], unsigned count, struct clipped *out)
{
    clip_corners(functions, count, out);
    clip_pieces(out);
}

/* Those of two corners below, and where the edges to the two others are at the threshold, are a prism. */
double clip_share_below(const double v[4], double threshold)
{
    const double t = threshold;
    if (t >= v[3])
        return 1;
    if (t <= v[0])
        return 0;
    if (t <= v[1])
        return (t - v[0]) / (v[1] - v[0]) * ((t - v[0]) / (v[2] - v[0])) * ((t - v[0]) / (v[3] - v[0]));
    if (t >= v[2])
        return 1 - (v[3] - t) / (v[3] - v[0]) * ((v[3] - t) / (v[3] - v[1])) * ((v[3] - t) / (v[3] - v[2]));
    const double a = (t - v[0]) / (v[2] - v[0]), b = (t - v[0]) / (v[3] - v[0]);
    const double c = (t - v[1]) / (v[2] - v[1]), d = (t - v[1]) / (v[3] - v[1]);
    return a * b + (1 - a) * b * c + (1 - b) * c * d;
}

void clip_sort(double values[4])
{
    static const int pairs[5][2] = {{0, 1}, {2, 3}, {0, 2}, {1, 3}, {1, 2}};
    for (int i = 0; i < 5; i++) {
        double a = values[pairs[i][0]], b = values[pairs[i][1]];
        values[pairs[i][0]] = a < b ? a : b;
        values[pairs[i][1]] = a < b ? b : a;
    }
}
