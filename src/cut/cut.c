/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/cut.h"

#include <stdlib.h>

#include "format/fail.h"
#include "src/cut/cut_add.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

void cut_fini(struct cut *cut)
{
    free(cut->ends);
    free(cut->along);
    free(cut->triangles);
    free(cut->tets);
    free(cut->lines);
    free(cut->below);
    pairs_fini(&cut->pairs);
    *cut = (struct cut){0};
}

void cut_empty(struct cut *cut)
{
    cut->vertex_count = cut->triangle_count = cut->line_count = 0;
}

enum tetlod_status cut_result(bool made, const struct cut *cut, struct tetlod_error *error)
{
    return made ? TETLOD_OK : tetlodi_fail_nomem(error, "a surface", 32 * (uint64_t)cut->triangle_count);
}

bool cut_add_vertex(struct cut *cut, uint32_t a, uint32_t b, double along, uint32_t *out)
{
    size_t count = (size_t)cut->vertex_count + 1;
    if (!array_reserve(&cut->ends, &cut->vertex_cap, count, 2 * sizeof *cut->ends) ||
        !ARRAY_RESERVE(cut->along, cut->along_cap, count))
        return false;
    *out = cut->vertex_count++;
    cut->ends[2 * (size_t)*out] = a;
    cut->ends[2 * (size_t)*out + 1] = b;
    cut->along[*out] = along;
    return true;
}

bool cut_add_triangle(struct cut *cut, uint32_t tet, uint32_t a, uint32_t b, uint32_t c)
{
    if (a == b || b == c || a == c)
        return true;
    size_t count = (size_t)cut->triangle_count + 1;
    if (!array_reserve(&cut->triangles, &cut->triangle_cap, count, 3 * sizeof *cut->triangles) ||
        !ARRAY_RESERVE(cut->tets, cut->tet_cap, count))
        return false;
    cut->tets[cut->triangle_count] = tet;
    uint32_t *triangle = cut->triangles + 3 * (size_t)cut->triangle_count++;
    triangle[0] = a;
    triangle[1] = b;
    triangle[2] = c;
    return true;
}

bool cut_is_inverted(const struct tetmesh *mesh, const uint32_t *corners)
{
    const double *p = mesh->positions;
    return tet_volume6(p + 3 * (size_t)corners[0], p + 3 * (size_t)corners[1], p + 3 * (size_t)corners[2],
                       p + 3 * (size_t)corners[3]) < 0;
}

/* ---- zero sets ---- */

/* Corners, those below the zero set first, by a mask of which are: even permutations, which keep the orientation. */
static const uint8_t orders[16][4] = {
    {0, 1, 2, 3}, {0, 1, 2, 3}, {1, 0, 3, 2}, {0, 1, 2, 3}, {2, 3, 0, 1}, {0, 2, 3, 1}, {1, 2, 0, 3}, {0, 1, 2, 3},
    {3, 2, 1, 0}, {0, 3, 1, 2}, {1, 3, 2, 0}, {1, 0, 3, 2}, {2, 3, 0, 1}, {2, 3, 0, 1}, {3, 2, 1, 0}, {0, 1, 2, 3},
};
static const uint8_t bits_set[16] = {0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4};

/* The vertex between a and b; twice the same: the mesh's own. */
static bool vertex_between(struct cut *out, uint32_t a, uint32_t b, const double *values, uint32_t *out_vertex)
{
    bool fresh;
    uint32_t *number = pairs_at(&out->pairs, a, b, &fresh);
    if (!number)
        return false;
    if (fresh && !cut_add_vertex(out, a, b, a == b ? 0 : values[a] / (values[a] - values[b]), number))
        return false;
    *out_vertex = *number;
    return true;
}

/* The surface's vertex on the edge from a (below) to b (not below). Where b is zero it is b itself. */
static bool crossing(struct cut *out, uint32_t a, uint32_t b, const double *values, uint32_t *out_vertex)
{
    return vertex_between(out, values[b] == 0 ? b : a, b, values, out_vertex);
}

/* The part of the zero set in one tetrahedron: a triangle if one corner is alone on its side, a quadrilateral if two
 * are. */
static bool cut_tet(const struct tetmesh *mesh, const double *values, uint32_t tet, unsigned below, struct cut *out)
{
    const uint32_t *corners = mesh->corners + 4 * (size_t)tet;
    uint32_t c[4], v[4];
    bool flip = cut_is_inverted(mesh, corners);
    for (int i = 0; i < 4; i++)
        c[i] = corners[orders[below][i]];
    if (bits_set[below] == 2)
        return crossing(out, c[0], c[2], values, &v[0]) && crossing(out, c[0], c[3], values, &v[1]) &&
               crossing(out, c[1], c[3], values, &v[2]) && crossing(out, c[1], c[2], values, &v[3]) &&
               cut_add_triangle(out, tet, v[0], v[flip ? 2 : 1], v[flip ? 1 : 2]) &&
               cut_add_triangle(out, tet, v[0], v[flip ? 3 : 2], v[flip ? 2 : 3]);
    bool one = bits_set[below] == 1;
    for (int i = 0; i < 3; i++)
        if (!crossing(out, c[one ? 0 : i], c[one ? i + 1 : 3], values, &v[i]))
            return false;
    return cut_add_triangle(out, tet, v[0], v[flip ? 2 : 1], v[flip ? 1 : 2]);
}

/* A cut begins: no vertex is between two others yet. Which are below is asked often and far apart: a byte each stays in
 * the cache. */
static bool begin(uint32_t count, const double *values, struct cut *out)
{
    cut_empty(out);
    if (!pairs_clear(&out->pairs, count) || !ARRAY_RESERVE(out->below, out->below_cap, count))
        return false;
    for (uint32_t v = 0; v < count; v++)
        out->below[v] = values[v] < 0;
    return true;
}

static bool add_zero(const struct tetmesh *mesh, const double *values, struct cut *out)
{
    const uint8_t *below = out->below;
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        const uint32_t *c = mesh->corners + 4 * (size_t)t;
        unsigned mask =
            below[c[0]] | (unsigned)below[c[1]] << 1 | (unsigned)below[c[2]] << 2 | (unsigned)below[c[3]] << 3;
        if (mask != 0 && mask != 15 && !cut_tet(mesh, values, t, mask, out))
            return false;
    }
    return true;
}

enum tetlod_status cut_zero(const struct tetmesh *mesh, const double *values, struct cut *out,
                            struct tetlod_error *error)
{
    return cut_result(begin(mesh->vertex_count, values, out) && add_zero(mesh, values, out), out, error);
}

/* ---- the surface of a part ---- */

static bool append_line(struct cut *cut, uint32_t a, uint32_t b)
{
    size_t count = (size_t)cut->line_count + 1;
    if (!array_reserve(&cut->lines, &cut->line_cap, count, 2 * sizeof *cut->lines))
        return false;
    cut->lines[2 * (size_t)cut->line_count] = a;
    cut->lines[2 * (size_t)cut->line_count++ + 1] = b;
    return true;
}

/* What is below of a triangle of the boundary: nothing, a triangle, a quadrilateral or all. */
static bool clip_triangle(uint32_t tet, const uint32_t corners[3], const double *values, struct cut *out)
{
    uint32_t v[4];
    int count = 0;
    for (int i = 0; i < 3; i++) {
        uint32_t a = corners[i], b = corners[(i + 1) % 3];
        if (out->below[a] && !vertex_between(out, a, a, values, &v[count++]))
            return false;
        if (out->below[a] != out->below[b] &&
            !crossing(out, out->below[a] ? a : b, out->below[a] ? b : a, values, &v[count++]))
            return false;
    }
    return !count || (cut_add_triangle(out, tet, v[0], v[1], v[2]) &&
                      (count == 3 || cut_add_triangle(out, tet, v[0], v[2], v[3])));
}

enum tetlod_status cut_clip(const struct tetmesh *mesh, const struct cut *boundary, const double *values,
                            struct cut *out,
                            struct tetlod_error *error)
{
    bool made = begin(mesh->vertex_count, values, out) && add_zero(mesh, values, out);
    for (size_t t = 0; made && t < boundary->triangle_count; t++) {
        const uint32_t *triangle = boundary->triangles + 3 * t;
        const uint32_t corners[3] = {boundary->ends[2 * (size_t)triangle[0]], boundary->ends[2 * (size_t)triangle[1]],
                                     boundary->ends[2 * (size_t)triangle[2]]};
        made = clip_triangle(boundary->tets[t], corners, values, out);
    }
    return cut_result(made, out, error);
}

/* What is below of a line. */
static bool trim_line(const uint32_t ends[2], const double *values, struct cut *out)
{
    uint32_t v[2];
    if (!out->below[ends[0]] && !out->below[ends[1]])
        return true;
    for (int i = 0; i < 2; i++)
        if (!(out->below[ends[i]] ? vertex_between(out, ends[i], ends[i], values, &v[i])
                                  : crossing(out, ends[1 - i], ends[i], values, &v[i])))
            return false;
    return v[0] == v[1] || append_line(out, v[0], v[1]);
}

enum tetlod_status cut_trim(const struct cut *surface, const double *values, struct cut *out,
                            struct tetlod_error *error)
{
    bool made = begin(surface->vertex_count, values, out);
    for (size_t t = 0; made && t < surface->triangle_count; t++)
        made = clip_triangle(surface->tets[t], surface->triangles + 3 * t, values, out);
    for (size_t l = 0; made && l < surface->line_count; l++)
        made = trim_line(surface->lines + 2 * l, values, out);
    return cut_result(made, out, error);
}

/* ---- edges of cells ---- */

static bool is_zero(const struct cut *cut, uint32_t vertex, const double *values)
{
    const uint32_t *ends = cut->ends + 2 * (size_t)vertex;
    return ends[0] != ends[1] || values[ends[0]] == 0;
}

/* Triangles also have edges that only divide a polygon. An edge of a cell lies in an edge of the mesh, or, as part of
 * the zero set, in a face: how many vertices of the mesh span it tells. */
static bool is_cell_edge(const struct cut *cut, uint32_t a, uint32_t b, const double *values)
{
    const uint32_t *p = cut->ends + 2 * (size_t)a, *q = cut->ends + 2 * (size_t)b;
    int span = 1 + (p[1] != p[0]);
    span += q[0] != p[0] && q[0] != p[1];
    span += q[1] != q[0] && q[1] != p[0] && q[1] != p[1];
    return span == 2 || (span == 3 && is_zero(cut, a, values) && is_zero(cut, b, values));
}

static bool add_line(struct cut *cut, uint32_t a, uint32_t b)
{
    bool fresh;
    uint32_t *number = pairs_at(&cut->pairs, a, b, &fresh);
    if (!number)
        return false;
    if (!fresh)
        return true;
    *number = cut->line_count;
    return append_line(cut, a, b);
}

enum tetlod_status cut_lines(struct cut *cut, const double *values, struct tetlod_error *error)
{
    bool made = pairs_clear(&cut->pairs, cut->vertex_count);
    cut->line_count = 0;
    for (size_t i = 0; made && i < 3 * (size_t)cut->triangle_count; i++) {
        uint32_t a = cut->triangles[i], b = cut->triangles[i % 3 == 2 ? i - 2 : i + 1];
        made = !is_cell_edge(cut, a, b, values) || add_line(cut, a, b);
    }
    return cut_result(made, cut, error);
}
