/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cut/cut_solid.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

void cut_solid_fini(struct cut_solid *solid)
{
    free(solid->ends);
    free(solid->along);
    free(solid->of);
    free(solid->corners);
    free(solid->tets);
    free(solid->on);
    free(solid->old_corners);
    free(solid->old_tets);
    pairs_fini(&solid->pairs);
    *solid = (struct cut_solid){0};
}

static enum tetlod_status result(bool made, const struct cut_solid *solid, struct tetlod_error *error)
{
    return made ? TETLOD_OK : tetlodi_fail_nomem(error, "a part of the mesh", 20 * (uint64_t)solid->tet_count);
}

static bool add_tet(struct cut_solid *solid, uint32_t number, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    if (a == b || a == c || a == d || b == c || b == d || c == d)
        return true; // a corner lies in the zero set: it has no volume
    size_t count = (size_t)solid->tet_count + 1;
    if (!array_reserve(&solid->corners, &solid->corner_cap, count, 4 * sizeof *solid->corners) ||
        !ARRAY_RESERVE(solid->tets, solid->tet_cap, count))
        return false;
    solid->tets[solid->tet_count] = number;
    uint32_t *tet = solid->corners + 4 * (size_t)solid->tet_count++;
    tet[0] = a, tet[1] = b, tet[2] = c, tet[3] = d;
    return true;
}

enum tetlod_status cut_solid_begin(uint32_t vertices, const uint32_t *corners, const uint32_t *tets,
                                   uint32_t tet_count, struct cut_solid *out, struct tetlod_error *error)
{
    out->old_count = vertices;
    out->new_count = out->tet_count = out->cuts = 0;
    bool made = ARRAY_RESERVE(out->on, out->on_cap, (size_t)vertices + 1);
    if (made)
        memset(out->on, 0, vertices);
    for (size_t t = 0; made && t < tet_count; t++) {
        const uint32_t *c = corners + 4 * t;
        made = add_tet(out, tets[t], c[0], c[1], c[2], c[3]);
    }
    return result(made, out, error);
}

/* ---- new vertices ---- */

/* The corners of the mesh that span a vertex, added to those of others. */
static uint32_t add_support(const struct cut_solid *solid, uint32_t vertex, uint32_t *of, uint32_t count)
{
    const uint32_t *own = vertex < solid->old_count ? &vertex : solid->of[vertex - solid->old_count];
    for (uint32_t i = 0; i < (vertex < solid->old_count ? 1 : SOLID_SUPPORT) && own[i] != TETLOD_NONE; i++) {
        bool known = false;
        for (uint32_t k = 0; k < count; k++)
            known = known || of[k] == own[i];
        if (!known && count < SOLID_SUPPORT)
            of[count++] = own[i];
    }
    return count;
}

static bool add_vertex(struct cut_solid *solid, uint32_t a, uint32_t b, double along, uint32_t *number)
{
    size_t count = (size_t)solid->new_count + 1;
    if (!array_reserve(&solid->ends, &solid->end_cap, count, 2 * sizeof *solid->ends) ||
        !ARRAY_RESERVE(solid->along, solid->along_cap, count) || !ARRAY_RESERVE(solid->of, solid->of_cap, count) ||
        !ARRAY_RESERVE(solid->on, solid->on_cap, solid->old_count + count))
        return false;
    *number = solid->old_count + solid->new_count;
    solid->ends[2 * (size_t)solid->new_count] = a;
    solid->ends[2 * (size_t)solid->new_count + 1] = b;
    solid->along[solid->new_count] = along;
    solid->on[*number] = (uint8_t)((solid->on[a] & solid->on[b]) | 1u << solid->cuts);
    uint32_t *of = solid->of[solid->new_count++];
    memset(of, 0xff, sizeof *solid->of);
    add_support(solid, b, of, add_support(solid, a, of, 0));
    return true;
}

/* From a (below) to b (not below). Where b is in the zero set it is b itself. */
static bool crossing(struct cut_solid *solid, uint32_t a, uint32_t b, const double *values, uint32_t *out)
{
    *out = b;
    if (values[b] == 0)
        return true;
    bool fresh;
    uint32_t *number = pairs_at(&solid->pairs, a, b, &fresh);
    if (!number || (fresh && !add_vertex(solid, a, b, values[a] / (values[a] - values[b]), number)))
        return false;
    *out = *number;
    return true;
}

/* ---- what is below of a tetrahedron ---- */

/* A prism with the corner that has the least number first: its two triangles, which keep the orientation. */
static const uint8_t turns[6][6] = {{0, 1, 2, 3, 4, 5}, {1, 2, 0, 4, 5, 3}, {2, 0, 1, 5, 3, 4},
                                    {3, 5, 4, 0, 2, 1}, {4, 3, 5, 1, 0, 2}, {5, 4, 3, 2, 1, 0}};

/* Each of its three quadrilaterals is divided from its least corner, also by the neighbour (Dompierre et al. 1999). */
static bool add_prism(struct cut_solid *solid, uint32_t number, const uint32_t corners[6])
{
    uint32_t least = 0, v[6];
    for (uint32_t i = 1; i < 6; i++)
        least = corners[i] < corners[least] ? i : least;
    for (int i = 0; i < 6; i++)
        v[i] = corners[turns[least][i]];
    uint32_t to_top = v[1] < v[5] ? v[1] : v[5], from_top = v[2] < v[4] ? v[2] : v[4];
    bool first = to_top < from_top;
    return add_tet(solid, number, v[0], v[1], v[2], v[first ? 5 : 4]) &&
           add_tet(solid, number, v[0], v[first ? 1 : 4], v[first ? 5 : 2], v[first ? 4 : 5]) &&
           add_tet(solid, number, v[0], v[4], v[5], v[3]);
}

/* Corners, those below first: even permutations, by a mask of which are below. */
static const uint8_t orders[16][4] = {
    {0, 1, 2, 3}, {0, 1, 2, 3}, {1, 0, 3, 2}, {0, 1, 2, 3}, {2, 3, 0, 1}, {0, 2, 3, 1}, {1, 2, 0, 3}, {0, 1, 2, 3},
    {3, 2, 1, 0}, {0, 3, 1, 2}, {1, 3, 2, 0}, {1, 0, 3, 2}, {2, 3, 0, 1}, {2, 3, 0, 1}, {3, 2, 1, 0}, {0, 1, 2, 3},
};

static bool divide(struct cut_solid *solid, uint32_t number, const uint32_t corners[4], unsigned below,
                   const double *values)
{
    uint32_t c[4], v[4];
    int count = __builtin_popcount(below);
    for (int i = 0; i < 4; i++)
        c[i] = corners[orders[below][i]];
    if (count == 4)
        return add_tet(solid, number, c[0], c[1], c[2], c[3]);
    if (count == 2)
        return crossing(solid, c[0], c[2], values, &v[0]) && crossing(solid, c[0], c[3], values, &v[1]) &&
               crossing(solid, c[1], c[2], values, &v[2]) && crossing(solid, c[1], c[3], values, &v[3]) &&
               add_prism(solid, number, (uint32_t[]){c[0], v[0], v[1], c[1], v[2], v[3]});
    for (int i = 0; i < 3; i++)
        if (count && !crossing(solid, c[count == 1 ? 0 : i], c[count == 1 ? i + 1 : 3], values, &v[i]))
            return false;
    return !count || (count == 1 ? add_tet(solid, number, c[0], v[0], v[1], v[2])
                                 : add_prism(solid, number, (uint32_t[]){c[0], c[1], c[2], v[0], v[1], v[2]}));
}

static void swap_tets(struct cut_solid *solid)
{
    uint32_t *corners = solid->corners, *tets = solid->tets;
    size_t corner_cap = solid->corner_cap, tet_cap = solid->tet_cap;
    solid->corners = solid->old_corners, solid->tets = solid->old_tets;
    solid->corner_cap = solid->old_corner_cap, solid->tet_cap = solid->old_tet_cap;
    solid->old_corners = corners, solid->old_tets = tets;
    solid->old_corner_cap = corner_cap, solid->old_tet_cap = tet_cap;
}

enum tetlod_status cut_solid_below(struct cut_solid *solid, const double *values, struct tetlod_error *error)
{
    uint32_t vertices = solid->old_count + solid->new_count, count = solid->tet_count;
    bool made = pairs_clear(&solid->pairs, vertices);
    swap_tets(solid);
    solid->tet_count = 0;
    for (uint32_t v = 0; made && v < vertices; v++)
        solid->on[v] |= (uint8_t)((values[v] == 0 ? 1u : 0u) << solid->cuts);
    for (size_t t = 0; made && t < count; t++) {
        const uint32_t *c = solid->old_corners + 4 * t;
        unsigned below = 0;
        for (int i = 0; i < 4; i++)
            below |= (values[c[i]] < 0 ? 1u : 0u) << i;
        made = divide(solid, solid->old_tets[t], c, below, values);
    }
    solid->cuts++;
    return result(made, solid, error);
}

void cut_solid_extend(const struct cut_solid *solid, double *values, uint32_t components)
{
    for (size_t i = 0; i < solid->new_count; i++)
        for (uint32_t c = 0; c < components; c++) {
            double a = values[(size_t)solid->ends[2 * i] * components + c];
            double b = values[(size_t)solid->ends[2 * i + 1] * components + c];
            values[(solid->old_count + i) * components + c] = a + solid->along[i] * (b - a);
        }
}

bool cut_solid_is_edge(const struct cut_solid *solid, const uint32_t *vertices, uint32_t count, bool in_zero_set)
{
    uint32_t of[SOLID_SUPPORT], span = 0;
    unsigned on = 0xff;
    for (uint32_t i = 0; i < count; i++) {
        span = add_support(solid, vertices[i], of, span);
        on &= solid->on[vertices[i]];
    }
    return span <= 2 || (span == 3 && (on || in_zero_set)) || (on & (on - 1));
}
