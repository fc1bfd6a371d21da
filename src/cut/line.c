/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/line.h"

#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/util/array.h"

/* Pieces that are shorter, and what they overlap by, is rounding: of the segment's length. */
static const double LEAST = 1e-12;

void cut_line_fini(struct cut_line *line)
{
    free(line->ends);
    *line = (struct cut_line){0};
}

static double triple(const double a[3], const double b[3], const double c[3])
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* Six times the signed volumes of p with each face of a tetrahedron: barycentric weights times the whole. */
static void weigh(const double *const corners[4], const double p[3], double out[4])
{
    double d[4][3];
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 3; i++)
            d[c][i] = corners[c][i] - p[i];
    out[0] = triple(d[1], d[2], d[3]);
    out[1] = -triple(d[0], d[2], d[3]);
    out[2] = triple(d[0], d[1], d[3]);
    out[3] = -triple(d[0], d[1], d[2]);
}

/* Could the segment meet the tetrahedron's box? */
static bool near_segment(const double *const corners[4], const double from[3], const double to[3])
{
    for (int i = 0; i < 3; i++) {
        double low = fmin(from[i], to[i]), high = fmax(from[i], to[i]);
        bool below = true, above = true;
        for (int c = 0; c < 4; c++) {
            below &= corners[c][i] < low;
            above &= corners[c][i] > high;
        }
        if (below || above)
            return false;
    }
    return true;
}

/* The part of the segment in which no weight is negative: weights are linear along it. */
static bool stretch(const double start[4], const double end[4], double sign, double out[2])
{
    out[0] = 0;
    out[1] = 1;
    for (int c = 0; c < 4; c++) {
        double a = sign * start[c], b = sign * end[c];
        if (a < 0 && b < 0)
            return false;
        if (a < 0)
            out[0] = fmax(out[0], a / (a - b));
        else if (b < 0)
            out[1] = fmin(out[1], a / (a - b));
    }
    return out[1] - out[0] > LEAST;
}

static int by_begin(const void *a, const void *b)
{
    const struct cut_line_end *p = a, *q = b;
    if (p->at != q->at)
        return p->at < q->at ? -1 : 1;
    return p[1].at < q[1].at ? 1 : p[1].at > q[1].at ? -1 : 0;
}

/* Cuts off what an earlier piece has. */
static void drop_overlaps(struct cut_line *line)
{
    uint32_t kept = 0;
    double reached = -1;
    for (uint32_t k = 0; k < line->count; k++) {
        struct cut_line_end begin = line->ends[2 * (size_t)k], end = line->ends[2 * (size_t)k + 1];
        if (end.at - fmax(begin.at, reached) <= LEAST)
            continue;
        if (begin.at < reached) {
            begin.value += (reached - begin.at) / (end.at - begin.at) * (end.value - begin.value);
            begin.at = reached;
        }
        reached = end.at;
        line->ends[2 * (size_t)kept] = begin;
        line->ends[2 * (size_t)kept++ + 1] = end;
    }
    line->count = kept;
}

bool cut_stretch(const double *const corners[4], const double from[3], const double to[3], double at[2],
                 double weights[2][4])
{
    double start[4], end[4];
    if (!near_segment(corners, from, to))
        return false;
    weigh(corners, from, start);
    weigh(corners, to, end);
    double whole = start[0] + start[1] + start[2] + start[3];
    if (whole == 0 || !stretch(start, end, whole < 0 ? -1 : 1, at))
        return false;
    for (int e = 0; e < 2; e++)
        for (int c = 0; c < 4; c++)
            weights[e][c] = (start[c] + at[e] * (end[c] - start[c])) / whole;
    return true;
}

enum tetlod_status cut_along(const struct tetmesh *mesh, const double *values, const double *of_tets,
                             const double from[3],
                             const double to[3], struct cut_line *out, struct tetlod_error *error)
{
    out->count = 0;
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *ids = mesh->corners + 4 * (size_t)t;
        const double *corners[4];
        double weights[2][4], part[2];
        for (int c = 0; c < 4; c++)
            corners[c] = mesh->positions + 3 * (size_t)ids[c];
        if (!cut_stretch(corners, from, to, part, weights))
            continue;
        if (!ARRAY_RESERVE(out->ends, out->cap, 2 * ((size_t)out->count + 1)))
            return tetlodi_fail_nomem(error, "the values along a line",
                                      2 * ((uint64_t)out->count + 1) * sizeof *out->ends);
        for (int e = 0; e < 2; e++) {
            double value = 0;
            for (int c = 0; c < 4; c++)
                value += weights[e][c] * values[ids[c]];
            out->ends[2 * (size_t)out->count + (size_t)e] = (struct cut_line_end){part[e], of_tets ? of_tets[t] :
                                                                                  value};
        }
        out->count++;
    }
    if (out->count)
        qsort(out->ends, out->count, 2 * sizeof *out->ends, by_begin);
    drop_overlaps(out);
    return TETLOD_OK;
}
