/* SPDX-License-Identifier: BSD-3-Clause */
/* Where a length has some value: tetrahedra that this surface may pass through are divided into eight, again and again,
 * until a length that is taken as linear between corners is nearly the true one, which is that of interpolated
 * components. */
#include <math.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

/* As a part of the longest vector: a colour map has 257 colours. */
static const double ACCURACY = 1.0 / 512;
enum { MAX_ROUNDS = 8, MAX_TETS = 1 << 20 };

/* What is looked for: lengths, or values of a function, from `low` to `high`. */
struct target {
    const struct view *view;
    const struct point_field *field;
    uint32_t components;
    double low, high;
};

static double product(const double *a, const double *b, uint32_t components)
{
    double sum = 0;
    for (uint32_t c = 0; c < components; c++)
        sum += a[c] * b[c];
    return sum;
}

/* May the function have such a value there? It is looked at in the corners and between them, and has as much room on
 * each side: nothing is proved. */
static bool may_have(const double *const corners[4], const struct target *target)
{
    double low = INFINITY, high = -INFINITY, row[MAX_FUNCTION_INPUTS];
    for (int i = 0; i < 4; i++)
        for (int j = i; j < 4; j++) {
            for (uint32_t c = 0; c < target->components; c++)
                row[c] = (corners[i][c] + corners[j][c]) / 2;
            double value = view_value_of(target->view, target->field, row);
            low = fmin(low, value);
            high = fmax(high, value);
        }
    double room = high - low;
    return target->low <= high + room && target->high >= low - room;
}

/* May a vector within the tetrahedron be that long? None is longer than the longest corner's, none is farther from the
 * mean than the corner that is. */
static bool may_meet(const double *const corners[4], const struct target *target)
{
    if (target->field == &target->view->defined.field)
        return may_have(corners, target);
    // products: of a corner and four times the mean
    double products[4], squares[4], mean = 0, longest = 0, farthest = 0;
    for (int i = 0; i < 4; i++) {
        products[i] = 0;
        for (int j = 0; j < 4; j++)
            products[i] += product(corners[i], corners[j], target->components);
        squares[i] = product(corners[i], corners[i], target->components);
        mean += products[i] / 16;
    }
    for (int i = 0; i < 4; i++) {
        farthest = fmax(farthest, squares[i] - products[i] / 2 + mean);
        longest = fmax(longest, sqrt(squares[i]));
    }
    const double rounding = 1e-7 * longest;
    return target->low <= longest && target->high >= sqrt(mean) - sqrt(farthest) - rounding;
}

/* What the value between two corners, taken as linear, is off by in the middle, where that of a length is largest or
 * nearly so. */
static double deviation_of(const double *a, const double *b, const struct target *target)
{
    double middle[MAX_FUNCTION_INPUTS];
    for (uint32_t c = 0; c < target->components; c++)
        middle[c] = (a[c] + b[c]) / 2;
    double ends = view_value_of(target->view, target->field, a) + view_value_of(target->view, target->field, b);
    return fabs(ends / 2 - view_value_of(target->view, target->field, middle));
}

static bool add_tet(struct view_fine *fine, const uint32_t corners[4], uint32_t parent)
{
    size_t count = (size_t)fine->mesh.tet_count + 1;
    if (!array_reserve(&fine->mesh.corners, &fine->corner_cap[0], count, 4 * sizeof *fine->mesh.corners) ||
        !ARRAY_RESERVE(fine->parents[0], fine->parent_cap[0], count))
        return false;
    for (int i = 0; i < 4; i++)
        fine->mesh.corners[4 * (count - 1) + (size_t)i] = corners[i];
    fine->parents[0][fine->mesh.tet_count++] = parent;
    return true;
}

/* The number of a new vertex, whose place and row the caller fills. */
static bool add_vertex(struct view_fine *fine, uint32_t *number)
{
    size_t count = (size_t)fine->mesh.vertex_count + 1;
    if (!array_reserve(&fine->mesh.positions, &fine->position_cap, count, 3 * sizeof *fine->mesh.positions) ||
        !ARRAY_RESERVE(fine->rows, fine->row_cap, count * fine->width))
        return false;
    *number = fine->mesh.vertex_count++;
    return true;
}

/* ---- what is divided ---- */

static bool take_vertex(struct view *view, const struct point_field *field, uint32_t vertex, uint32_t *out)
{
    struct view_fine *fine = &view->fine;
    const struct point_field *shade = view_length_field(view);
    bool fresh;
    uint32_t *number = pairs_at(&fine->pairs, vertex, vertex, &fresh);
    if (!number || (fresh && !add_vertex(fine, number)))
        return false;
    *out = *number;
    if (!fresh)
        return true;
    double *row = fine->rows + (size_t)*number * fine->width, *colour = row + field->components;
    for (size_t i = 0; i < 3; i++)
        fine->mesh.positions[3 * (size_t)*number + i] = view_drawn(view)->positions[3 * (size_t)vertex + i];
    for (size_t c = 0; c < field->components; c++)
        row[c] = field->values[(size_t)vertex * field->components + c];
    for (size_t c = 0; shade && c < shade->components; c++)
        colour[c] = shade->values[(size_t)vertex * shade->components + c];
    if (!shade)
        colour[0] = view->shade[vertex];
    return true;
}

static bool take_tets(struct view *view, const struct point_field *field, const struct target *target)
{
    const struct tetmesh *drawn = view_drawn(view);
    const struct point_field *shade = view_length_field(view);
    struct view_fine *fine = &view->fine;
    fine->mesh.vertex_count = fine->mesh.tet_count = 0;
    fine->width = field->components + (shade ? shade->components : 1);
    if (!pairs_clear(&fine->pairs, drawn->vertex_count))
        return false;
    for (uint32_t t = 0; t < drawn->tet_count; t++) {
        const uint32_t *ids = drawn->corners + 4 * (size_t)t;
        const double *corners[4];
        uint32_t own[4];
        for (int i = 0; i < 4; i++)
            corners[i] = field->values + (size_t)ids[i] * field->components;
        if (!may_meet(corners, target))
            continue;
        for (int i = 0; i < 4; i++)
            if (!take_vertex(view, field, ids[i], &own[i]))
                return false;
        if (!add_tet(fine, own, t))
            return false;
    }
    return true;
}

/* ---- a round ---- */

/* Between two vertices, of which every linear array has the mean. */
static bool halve(struct view_fine *fine, uint32_t a, uint32_t b, uint32_t *out)
{
    bool fresh;
    uint32_t *number = pairs_at(&fine->pairs, a, b, &fresh);
    if (!number || (fresh && !add_vertex(fine, number)))
        return false;
    *out = *number;
    if (!fresh)
        return true;
    double *place = fine->mesh.positions, *rows = fine->rows;
    for (size_t i = 0; i < 3; i++)
        place[3 * (size_t)*number + i] = (place[3 * (size_t)a + i] + place[3 * (size_t)b + i]) / 2;
    for (size_t c = 0; c < fine->width; c++)
        rows[*number * (size_t)fine->width + c] = (rows[a * (size_t)fine->width + c] +
                                                   rows[b * (size_t)fine->width + c]) / 2;
    return true;
}

/* Corners 0 to 3, and between them 01, 02, 03, 12, 13, 23. Around the diagonal from 01 to 23 there are four. */
static const uint8_t ends[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
static const uint8_t children[8][4] = {{0, 4, 5, 6}, {4, 1, 7, 8}, {5, 7, 2, 9}, {6, 8, 9, 3},
                                       {4, 9, 5, 7}, {4, 9, 7, 8}, {4, 9, 8, 6}, {4, 9, 6, 5}};

static bool divide_tet(struct view_fine *fine, uint32_t tet, const struct target *target)
{
    uint32_t v[10];
    for (int i = 0; i < 4; i++)
        v[i] = fine->coarse.corners[4 * (size_t)tet + (size_t)i];
    for (int e = 0; e < 6; e++)
        if (!halve(fine, v[ends[e][0]], v[ends[e][1]], &v[4 + e]))
            return false;
    for (int k = 0; k < 8; k++) {
        const double *corners[4];
        uint32_t own[4];
        for (int i = 0; i < 4; i++) {
            own[i] = v[children[k][i]];
            corners[i] = fine->rows + (size_t)own[i] * fine->width;
        }
        if (may_meet(corners, target) && !add_tet(fine, own, fine->parents[1][tet]))
            return false;
    }
    return true;
}

static void swap_corners(struct view_fine *fine)
{
    struct tetmesh *mesh = &fine->mesh, *coarse = &fine->coarse;
    uint32_t *corners = mesh->corners, *parents = fine->parents[0];
    size_t corner_cap = fine->corner_cap[0], parent_cap = fine->parent_cap[0];
    mesh->corners = coarse->corners;
    coarse->corners = corners;
    coarse->tet_count = mesh->tet_count;
    mesh->tet_count = 0;
    fine->parents[0] = fine->parents[1];
    fine->parents[1] = parents;
    fine->corner_cap[0] = fine->corner_cap[1];
    fine->corner_cap[1] = corner_cap;
    fine->parent_cap[0] = fine->parent_cap[1];
    fine->parent_cap[1] = parent_cap;
}

/* The largest of its edges. */
static double deviation_of_tet(const struct view_fine *fine, const uint32_t *corners, const struct target *target)
{
    double most = 0;
    for (int e = 0; e < 6; e++)
        most = fmax(most, deviation_of(fine->rows + (size_t)corners[ends[e][0]] * fine->width,
                                       fine->rows + (size_t)corners[ends[e][1]] * fine->width, target));
    return most;
}

static void measure(struct view_fine *fine, const struct target *target)
{
    fine->deviation = 0;
    for (size_t t = 0; t < fine->mesh.tet_count; t++)
        fine->deviation = fmax(fine->deviation, deviation_of_tet(fine, fine->mesh.corners + 4 * t, target));
}

/* One that is near enough stays. Beside one that is divided it has straight edges: what gapes between them is within
 * the accuracy. */
static bool divide_all(struct view_fine *fine, const struct target *target)
{
    swap_corners(fine);
    if (!pairs_clear(&fine->pairs, fine->mesh.vertex_count))
        return false;
    for (uint32_t t = 0; t < fine->coarse.tet_count; t++) {
        const uint32_t *corners = fine->coarse.corners + 4 * (size_t)t;
        bool is_near = deviation_of_tet(fine, corners, target) <= fine->accuracy;
        if (is_near ? !add_tet(fine, corners, fine->parents[1][t]) : !divide_tet(fine, t, target))
            return false;
    }
    measure(fine, target);
    return true;
}

static double longest_of(const struct view *view, const struct point_field *field)
{
    double longest = 0;
    for (size_t v = 0; v < view->shown.vertex_count; v++)
        longest = fmax(longest, fabs(view_value_of(view, field, field->values + v * field->components)));
    return longest;
}

enum tetlod_status view_divide(struct view *view, const struct point_field *field, double value, bool margin)
{
    struct view_fine *fine = &view->fine;
    fine->accuracy = ACCURACY * longest_of(view, field);
    const struct target target = {view, field, field->components, value, margin ? value + fine->accuracy : value};
    bool made = take_tets(view, field, &target);
    measure(fine, &target);
    for (int i = 0; made && i < MAX_ROUNDS && fine->deviation > fine->accuracy && fine->mesh.tet_count < MAX_TETS / 8;
         i++)
        made = divide_all(fine, &target);
    double *lengths = made ? array_resize(fine->lengths, fine->mesh.vertex_count, sizeof *lengths) : NULL;
    if (!lengths)
        return tetlodi_fail_nomem(&view->error, "an isosurface", 64 * (uint64_t)fine->mesh.tet_count);
    fine->lengths = lengths;
    for (uint32_t v = 0; v < fine->mesh.vertex_count; v++)
        lengths[v] = view_value_of(view, field, fine->rows + (size_t)v * fine->width);
    return TETLOD_OK;
}
