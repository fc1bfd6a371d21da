/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What shapes.c and odd.c leave out: seams of double points, tetrahedra listed either way round, flat tetrahedra on the
 * boundary, needles, boundaries that are almost flat or almost meet, double tetrahedra, regions; and fields of one
 * peak, of whole numbers, of extreme sizes.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/attack/oracle.h"
#include "tests/attack/shapes.h"

static const double PI = 3.14159265358979323846;

static double power_of_ten(struct dice *dice, double low, double high)
{
    return pow(10, low + (high - low) * dice_unit(dice));
}

static void round_positions(struct shape *s)
{
    for (uint32_t i = 0; i < 3 * s->vertices && !s->wide; i++)
        s->positions[i] = (double)(float)s->positions[i];
}

static void find_bounds(const struct shape *s, double low[3], double size[3])
{
    for (uint32_t d = 0; d < 3; d++) {
        double high = -INFINITY;
        low[d] = INFINITY;
        for (uint32_t v = 0; v < s->vertices; v++) {
            low[d] = fmin(low[d], s->positions[3 * v + d]);
            high = fmax(high, s->positions[3 * v + d]);
        }
        size[d] = high > low[d] ? high - low[d] : 1;
    }
}

/* ---- connections */

static double middle_of(const struct shape *s, uint32_t t, uint32_t d)
{
    double sum = 0;
    for (uint32_t c = 0; c < 4; c++)
        sum += s->positions[3 * s->corners[4 * t + c] + d] / 4;
    return sum;
}

/* Splits the mesh into pieces of tetrahedra, each with vertices of its own at the seams; values may jump there. */
static void split(struct shape *s, struct dice *dice, uint32_t pieces, double jump)
{
    double low[3], size[3], place = 0.2 + 0.6 * dice_unit(dice);
    uint32_t axis = dice_below(dice, 3), before = s->vertices, *copies = calloc((size_t)before * pieces,
                                                                                sizeof *copies);
    if (!copies)
        exit(2);
    find_bounds(s, low, size);
    for (uint32_t t = 0; t < s->tets; t++) {
        double x = (middle_of(s, t, axis) - low[axis]) / size[axis];
        uint32_t piece = pieces == 2 ? x > place : dice_below(dice, pieces);
        for (uint32_t c = 0; c < 4; c++) {
            uint32_t *v = &s->corners[4 * t + c], *copy = &copies[(size_t)*v * pieces + piece];
            if (!*copy && s->vertices < SHAPE_MAX_VERTICES)
                *copy = 1 + shape_copy_vertex(s, *v);
            *v = *copy ? *copy - 1 : *v;
        }
        for (uint32_t c = 0; c < 4 && jump > 0; c++)
            s->body[s->corners[4 * t + c]] = piece;
    }
    free(copies);
    shape_drop_unused(s);
    for (uint32_t v = 0; v < s->vertices; v++)
        for (uint32_t f = 0; f < s->field_count && jump > 0; f++)
            for (uint32_t c = 0; c < s->fields[f].components; c++) {
                double *value = &s->fields[f].values[s->fields[f].components * v + c];
                *value += jump * s->body[v] * fabs(*value);
                *value = s->fields[f].wide ? *value : (double)(float)*value;
            }
}

static void swap_corners(struct shape *s, uint32_t t)
{
    uint32_t swap = s->corners[4 * t];
    s->corners[4 * t] = s->corners[4 * t + 1];
    s->corners[4 * t + 1] = swap;
}

/* Adds tetrahedra over two boundary faces with a common edge: where the boundary is flat, they are. */
static void add_flat(struct shape *s, struct dice *dice)
{
    const struct oracle_mesh mesh = {.vertices = s->vertices, .tets = s->tets, .corners = s->corners};
    struct oracle_face *faces = oracle_faces(&mesh);
    uint32_t count = 0, wanted = 1 + dice_below(dice, 6), *used = calloc(s->vertices, sizeof *used);
    if (!used)
        exit(2);
    for (uint32_t i = 0; i < 4 * mesh.tets; i++)
        if ((!i || !oracle_same_face(&faces[i], &faces[i - 1])) &&
            (i + 1 == 4 * mesh.tets || !oracle_same_face(&faces[i], &faces[i + 1])))
            faces[count++] = faces[i];
    for (uint32_t trial = 0; trial < 200 && wanted && s->tets < SHAPE_MAX_TETS; trial++) {
        const uint32_t *a = faces[dice_below(dice, count)].v, *b = faces[dice_below(dice, count)].v;
        uint32_t common = 0, other = 0;
        for (int i = 0; i < 3; i++) {
            bool both = b[i] == a[0] || b[i] == a[1] || b[i] == a[2];
            common += both;
            other = both ? other : b[i];
        }
        if (common != 2 || used[a[0]] || used[a[1]] || used[a[2]] || used[other])
            continue;
        used[a[0]] = used[a[1]] = used[a[2]] = used[other] = 1;
        memcpy(s->corners + 4 * s->tets, a, 3 * sizeof *a);
        s->corners[4 * s->tets++ + 3] = other;
        wanted--;
    }
    free(used);
    free(faces);
}

/* Some tetrahedra are there twice, by the same vertices or by others at the same points. */
static void double_some(struct shape *s, struct dice *dice)
{
    uint32_t count = 1 + dice_below(dice, 3);
    bool own = dice_once_in(dice, 2);
    for (uint32_t i = 0; i < count && s->tets < SHAPE_MAX_TETS && s->vertices + 4 < SHAPE_MAX_VERTICES; i++) {
        uint32_t *to = s->corners + 4 * s->tets;
        memcpy(to, s->corners + 4 * dice_below(dice, s->tets), 4 * sizeof *to);
        for (int c = 0; c < 4 && own; c++)
            to[c] = shape_copy_vertex(s, to[c]);
        s->tets++;
    }
}

/* ---- positions */

/* Flat along a direction that is no axis. */
static void flatten(struct shape *s, struct dice *dice)
{
    double low[3], size[3], n[3], length = 0, by = power_of_ten(dice, -6, -2);
    find_bounds(s, low, size);
    for (int d = 0; d < 3; d++) {
        n[d] = dice_unit(dice) - 0.5;
        length += n[d] * n[d];
    }
    for (uint32_t v = 0; v < s->vertices; v++) {
        double *p = s->positions + 3 * v, along = 0;
        for (int d = 0; d < 3; d++)
            along += (p[d] - low[d]) * n[d] / length;
        for (int d = 0; d < 3; d++)
            p[d] -= (1 - by) * along * n[d];
    }
}

static void roughen(struct shape *s, struct dice *dice)
{
    double low[3], size[3], by = power_of_ten(dice, -14, -2);
    find_bounds(s, low, size);
    for (uint32_t i = 0; i < 3 * s->vertices; i++)
        s->positions[i] += by * size[i % 3] * (2 * dice_unit(dice) - 1);
}

/* Bends the mesh into a ring that stays open by a gap, or overlaps its own end; a screw may take the ends past each
 * other. */
static void close_ring(struct shape *s, struct dice *dice)
{
    double low[3], size[3], gap = (dice_once_in(dice, 3) ? -1 : 1) * power_of_ten(dice, -9, -1);
    double rise = dice_once_in(dice, 2) ? power_of_ten(dice, -6, 0) : 0, waist = dice_once_in(dice, 2) ? 0 : 0.4;
    find_bounds(s, low, size);
    for (uint32_t v = 0; v < s->vertices; v++) {
        double *p = s->positions + 3 * v, angle = 2 * PI * (p[0] - low[0]) / size[0] * (1 - gap),
               y = (p[1] - low[1]) / size[1], z = (p[2] - low[2]) / size[2],
               r = size[0] * (1 + 0.4 * y + 0.1 * waist * sin(3 * angle));
        p[0] = r * cos(angle);
        p[1] = r * sin(angle);
        p[2] = size[0] * (0.4 * z + rise * angle / PI);
    }
}

/* A waist of almost no width. */
static void pinch(struct shape *s, struct dice *dice)
{
    double low[3], size[3], left = dice_once_in(dice, 3) ? 0 : power_of_ten(dice, -9, -1), place = dice_unit(dice);
    uint32_t a = dice_below(dice, 3), b = (a + 1) % 3;
    find_bounds(s, low, size);
    for (uint32_t v = 0; v < s->vertices; v++) {
        double *p = s->positions + 3 * v, from = fabs((p[a] - low[a]) / size[a] - place);
        p[b] = low[b] + size[b] / 2 + (p[b] - low[b] - size[b] / 2) * (left + from);
    }
}

/* Waves on every side: a curved boundary, in and out. */
static void wave(struct shape *s, struct dice *dice)
{
    double low[3], size[3], by = power_of_ten(dice, -4, -1), often = 2 + 20 * dice_unit(dice);
    find_bounds(s, low, size);
    for (uint32_t v = 0; v < s->vertices; v++) {
        double *p = s->positions + 3 * v, x[3];
        for (int d = 0; d < 3; d++)
            x[d] = (p[d] - low[d]) / size[d];
        for (int d = 0; d < 3; d++)
            p[d] += by * size[d] * sin(often * x[(d + 1) % 3] + d) * cos(often * x[(d + 2) % 3]);
    }
}

/* ---- values */

static double value_of(uint32_t kind, double value, uint32_t v, uint32_t peak, double size, double exponent,
                       struct dice *dice)
{
    switch (kind) {
    case 0:
        return v == peak ? 5 + size : 5;
    case 1:
        return floor(7 * value / size);
    case 2:
        return value / size * pow(10, exponent);
    case 3:
        return dice_unit(dice) < 0.5 ? -1 : 1e-12 * dice_unit(dice);
    case 4:
        return pow(10, exponent / 10 * dice_unit(dice));
    default:
        return v % 2 ? size : -size;
    }
}

static void replace_values(struct shape *s, struct dice *dice)
{
    struct shape_field *field = &s->fields[dice_below(dice, s->field_count)];
    uint32_t kind = dice_below(dice, 6), peak = dice_below(dice, s->vertices),
             only = dice_below(dice, field->components);
    double size = 0, exponent = (field->wide ? 290 : 36) * (2 * dice_unit(dice) - 1);
    for (uint32_t i = 0; i < s->vertices * field->components; i++)
        size = fmax(size, fabs(field->values[i]));
    size = size > 0 ? size : 1;
    for (uint32_t v = 0; v < s->vertices; v++) {
        double *value = &field->values[v * field->components + only];
        *value = value_of(kind, *value, v, peak, size, exponent, dice);
        *value = field->wide ? *value : (double)(float)*value;
    }
}

static void add_regions(struct shape *s, struct dice *dice)
{
    double low[3], size[3];
    uint32_t axis = dice_below(dice, 3), count = 2 + dice_below(dice, 3);
    bool layers = !dice_once_in(dice, 3);
    s->region = calloc(s->tets, sizeof *s->region);
    if (!s->region)
        exit(2);
    find_bounds(s, low, size);
    for (uint32_t t = 0; t < s->tets; t++) {
        double x = (middle_of(s, t, axis) - low[axis]) / size[axis];
        s->region[t] = layers ? (uint32_t)(fmin(0.999, fmax(0, x)) * count) : dice_below(dice, count);
    }
}

void shape_make_rare(struct shape *out, struct dice *dice)
{
    static const char *const kinds[] = {"scattered", "cut", "cut with a jump", "turned", "some turned",
                                        "flat on the boundary", "double tetrahedra",
                                        "flattened", "rough", "ring", "waist", "waves", "plain"};
    shape_make(out, dice);
    uint32_t kind = dice_below(dice, sizeof kinds / sizeof *kinds);
    static void (*const bends[])(struct shape *, struct dice *) = {flatten, roughen, close_ring, pinch, wave};
    out->kind = kinds[kind];
    if (kind == 0)
        split(out, dice, 3 + dice_below(dice, 30), 0);
    else if (kind <= 2)
        split(out, dice, 2, kind == 2 ? power_of_ten(dice, -6, 0) : 0);
    for (uint32_t t = 0; t < out->tets && (kind == 3 || kind == 4); t++)
        if (kind == 3 || dice_once_in(dice, 2))
            swap_corners(out, t);
    if (kind == 5)
        add_flat(out, dice);
    if (kind == 6)
        double_some(out, dice);
    if (kind >= 7 && kind < 12)
        bends[kind - 7](out, dice);
    round_positions(out);
    if (dice_once_in(dice, 2))
        replace_values(out, dice);
    if (dice_once_in(dice, 4))
        add_regions(out, dice);
}
