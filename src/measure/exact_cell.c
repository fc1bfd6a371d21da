/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/exact_cell.h"

#include <math.h>
#include <string.h>

/* By weights: intersections that are thinner are contacts. */
static const double THIN = 1e-9;

/* Which tetrahedra hold an end is asked this much inside the intersection: on the face itself neighbours hold it,
 * too. */
static const double INWARDS = 1e-7;

/* Of the intersection's size: ends that are nearer are one corner of it, found by several edges. */
static const double SAME_END = 1e-20;

/* A weight in 113 bits is wrong by less than this. */
static const double NOISE = 1e-20;

static quad magnitude(quad x)
{
    return x < 0 ? -x : x;
}

static quad larger_quad(quad a, quad b)
{
    return a > b ? a : b;
}

static void cross(const quad a[3], const quad b[3], quad out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

void exact_map_set(struct exact_map *map, const double *const corners[4])
{
    quad edges[3][3], volume6 = 0;
    map->origin = corners[0];
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++)
            edges[i][d] = (quad)corners[i + 1][d] - corners[0][d];
    for (int i = 0; i < 3; i++)
        cross(edges[(i + 1) % 3], edges[(i + 2) % 3], map->rows[i]);
    for (int d = 0; d < 3; d++)
        volume6 += edges[0][d] * map->rows[0][d];
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++)
            map->rows[i][d] /= volume6;
}

void exact_weights(const struct exact_map *map, const quad x[3], quad weights[4])
{
    const quad r[3] = {x[0] - map->origin[0], x[1] - map->origin[1], x[2] - map->origin[2]};
    weights[0] = 1;
    for (int i = 0; i < 3; i++) {
        weights[i + 1] = map->rows[i][0] * r[0] + map->rows[i][1] * r[1] + map->rows[i][2] * r[2];
        weights[0] -= weights[i + 1];
    }
}

/* The part of the edge from a to b of tetrahedron m that is inside the other one, in which its corners have the weights
 * `in`. */
static void clip_edge(struct exact_cell *cell, int m, int a, int b, quad in[4][4])
{
    quad range[2] = {0, 1};
    for (int k = 0; k < 4; k++) {
        quad from = in[a][k], to = in[b][k];
        if (from < 0 && to < 0)
            return;
        if (from < 0 && from / (from - to) > range[0])
            range[0] = from / (from - to);
        if (to < 0 && from / (from - to) < range[1])
            range[1] = from / (from - to);
    }
    for (int end = 0; end < 2 && range[0] <= range[1]; end++, cell->count++)
        for (int d = 0; d < 3; d++) {
            quad from = cell->corners[m][a][d];
            cell->ends[cell->count][d] = from + range[end] * (cell->corners[m][b][d] - from);
        }
}

/* How often a corner was found hangs on the order of the tetrahedra's corners: one of each is kept, so that the middle
 * does not. */
static void merge_ends(struct exact_cell *cell)
{
    int found = cell->count;
    quad size = 0;
    for (int i = 1; i < found; i++)
        for (int d = 0; d < 3; d++)
            size = larger_quad(size, magnitude(cell->ends[i][d] - cell->ends[0][d]));
    cell->count = 0;
    for (int i = 0; i < found; i++) {
        bool is_new = true;
        for (int j = 0; j < cell->count && is_new; j++) {
            quad apart = 0;
            for (int d = 0; d < 3; d++)
                apart = larger_quad(apart, magnitude(cell->ends[i][d] - cell->ends[j][d]));
            is_new = apart > SAME_END * size;
        }
        if (is_new)
            memmove(cell->ends[cell->count++], cell->ends[i], sizeof *cell->ends);
    }
}

bool exact_cell_clip(struct exact_cell *cell)
{
    quad weights[4][4];
    cell->count = 0;
    for (int m = 0; m < 2; m++)
        exact_map_set(&cell->maps[m], cell->corners[m]);
    for (int m = 0; m < 2; m++) {
        for (int c = 0; c < 4; c++) {
            const double *p = cell->corners[m][c];
            exact_weights(&cell->maps[!m], (const quad[3]){p[0], p[1], p[2]}, weights[c]);
            for (int k = 0; k < 4; k++) // on a face's plane is neither side of it
                weights[c][k] = magnitude(weights[c][k]) <= NOISE ? 0 : weights[c][k];
        }
        for (int a = 0; a < 4; a++)
            for (int b = 0; b < a; b++)
                clip_edge(cell, m, a, b, weights);
    }
    merge_ends(cell);
    for (int d = 0; d < 3; d++) {
        cell->middle[d] = 0;
        for (int i = 0; i < cell->count; i++)
            cell->middle[d] += cell->ends[i][d] / cell->count;
    }
    for (int m = 0; m < 2 && cell->count; m++) {
        exact_weights(&cell->maps[m], cell->middle, weights[0]);
        for (int k = 0; k < 4; k++)
            if (weights[0][k] < THIN)
                return false;
    }
    return cell->count > 0;
}

/* Values are taken less one of them: exactly, so that a field far from 0 loses nothing. */
static quad value_at(const struct exact_map *map, const quad x[3], const double values[4], double base)
{
    quad weights[4], sum = 0;
    exact_weights(map, x, weights);
    for (int k = 0; k < 4; k++)
        sum += weights[k] * ((quad)values[k] - base);
    return sum;
}

static quad difference(const struct exact_cell *cell, const struct exact_map *map, const quad x[3],
                       const double values[2][4])
{
    return magnitude(value_at(map, x, values[1], values[0][0]) - value_at(&cell->maps[0], x, values[0], values[0][0]));
}

quad exact_cell_difference(const struct exact_cell *cell, int end, const double values[2][4])
{
    return difference(cell, &cell->maps[1], cell->ends[end], values);
}

uint32_t exact_cell_other(const struct exact_cell *cell, int end, const double *const corners[4],
                          const double values[2][4], quad *out)
{
    struct exact_map map;
    uint32_t held = 0;
    exact_map_set(&map, corners);
    for (int side = 0; side < cell->count; side++) {
        quad x[3], weights[4];
        bool holds = true;
        for (int d = 0; d < 3; d++)
            x[d] = cell->ends[end][d] + INWARDS * ((cell->middle[d] + cell->ends[side][d]) / 2 - cell->ends[end][d]);
        exact_weights(&map, x, weights);
        for (int k = 0; k < 4; k++)
            holds &= weights[k] >= -NOISE;
        held |= (uint32_t)holds << side;
    }
    *out = held ? difference(cell, &map, cell->ends[end], values) : INFINITY;
    return held;
}

static quad dot(const quad a[3], const quad b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* r: from a to p. */
static quad segment_distance2(const quad r[3], const quad edge[3])
{
    quad length2 = dot(edge, edge), t = length2 > 0 ? dot(r, edge) / length2 : 0, sum = 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    for (int d = 0; d < 3; d++)
        sum += (r[d] - t * edge[d]) * (r[d] - t * edge[d]);
    return sum;
}

double exact_triangle_distance2(const double p[3], const double *const corners[3])
{
    quad edges[3][3], r[3][3], normal[3], side[3], best = -1;
    bool over = true;
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++) {
            edges[i][d] = (quad)corners[(i + 1) % 3][d] - corners[i][d];
            r[i][d] = (quad)p[d] - corners[i][d];
        }
    cross(edges[0], edges[1], normal);
    for (int i = 0; i < 3; i++) {
        quad distance2 = segment_distance2(r[i], edges[i]);
        best = best < 0 || distance2 < best ? distance2 : best;
        cross(edges[i], r[i], side);
        over &= dot(normal, side) >= 0;
    }
    quad height = dot(normal, r[0]), size2 = dot(normal, normal);
    return (double)(over && size2 > 0 ? height * height / size2 : best);
}
