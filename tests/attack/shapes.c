/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Outline: a recipe makes one or more bodies in about the unit cube (blocks of six tetrahedra a cell, bent by a map, or
 * Delaunay clouds), spoils them (holes, folds, slivers, coincident points), moves and stretches the whole, rounds it to
 * its type, and gives it fields of random kinds, offsets and magnitudes.
 */
#include "tests/attack/shapes.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

static uint64_t dice_next(struct dice *dice)
{
    uint64_t z = dice->state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

uint32_t dice_below(struct dice *dice, uint32_t bound)
{
    return (uint32_t)(dice_next(dice) % bound);
}

double dice_unit(struct dice *dice)
{
    return (double)(dice_next(dice) >> 11) * 0x1p-53;
}

bool dice_once_in(struct dice *dice, uint32_t times)
{
    return dice_below(dice, times) == 0;
}

static double between(struct dice *dice, double low, double high)
{
    return low + (high - low) * dice_unit(dice);
}

/* ---- bodies */

static uint32_t add_vertex(struct shape *s, const double p[3], uint32_t body)
{
    if (s->vertices == SHAPE_MAX_VERTICES)
        exit(2);
    memcpy(s->positions + 3 * s->vertices, p, 3 * sizeof *p);
    s->body[s->vertices] = body;
    return s->vertices++;
}

static void add_tet(struct shape *s, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    if (s->tets == SHAPE_MAX_TETS)
        exit(2);
    uint32_t *to = s->corners + 4 * s->tets++;
    to[0] = a, to[1] = b, to[2] = c, to[3] = d;
}

/* From parameters in [0, 1]³ to space. */
typedef void map_function(double p[3], double shape);

static void map_box(double p[3], double shape)
{
    (void)p;
    (void)shape;
}

/* Cubes around the centre become spheres. */
static void map_ball(double p[3], double shape)
{
    double most = 0, length = 0;
    (void)shape;
    for (int d = 0; d < 3; d++) {
        p[d] = 2 * p[d] - 1;
        most = fmax(most, fabs(p[d]));
        length += p[d] * p[d];
    }
    for (int d = 0; d < 3; d++)
        p[d] = 0.5 + 0.5 * (length > 0 ? p[d] * most / sqrt(length) : 0);
}

static void map_disc(double *x, double *y)
{
    double a = 2 * *x - 1, b = 2 * *y - 1, length = hypot(a, b), most = fmax(fabs(a), fabs(b));
    *x = length > 0 ? a * most / length : 0;
    *y = length > 0 ? b * most / length : 0;
}

static void map_torus(double p[3], double shape)
{
    double angle = 2 * PI * p[0], x = p[1], y = p[2];
    map_disc(&x, &y);
    double r = 0.5 - 0.25 * shape + 0.22 * shape * x;
    p[0] = 0.5 + r * cos(angle);
    p[1] = 0.5 + r * sin(angle);
    p[2] = 0.5 + 0.22 * shape * y;
}

/* A trefoil, thick by `shape`. */
static void map_knot(double p[3], double shape)
{
    double t = 2 * PI * p[0], x = 0.12 * shape * (p[1] - 0.5), y = 0.12 * shape * (p[2] - 0.5);
    const double along[3] = {cos(t) + 4 * cos(2 * t), -sin(t) + 4 * sin(2 * t), -3 * cos(3 * t)};
    const double out[3] = {-cos(3 * t) * cos(2 * t), cos(3 * t) * sin(2 * t), sin(3 * t)}; // about across `along`
    const double at[3] = {sin(t) + 2 * sin(2 * t), cos(t) - 2 * cos(2 * t), -sin(3 * t)};
    const double side[3] = {along[1] * out[2] - along[2] * out[1], along[2] * out[0] - along[0] * out[2],
                            along[0] * out[1] - along[1] * out[0]};
    double length = sqrt(side[0] * side[0] + side[1] * side[1] + side[2] * side[2]);
    for (int d = 0; d < 3; d++)
        p[d] = 0.5 + at[d] / 7 + x * out[d] + (length > 0 ? y * side[d] / length : 0);
}

/* A sheet rolled by up to most of a turn. */
static void map_plate(double p[3], double shape)
{
    double angle = 5 * shape * (p[0] - 0.5), r = 0.3 + 0.05 * shape * p[2];
    p[0] = 0.5 + r * sin(angle);
    p[2] = 0.5 + r * cos(angle);
}

/* All of the face x = 0 becomes a line: coincident points, and tetrahedra without volume. */
static void map_pole(double p[3], double shape)
{
    double angle = 2 * PI * (0.1 + 0.8 * shape) * p[1], r = 0.5 * p[0];
    p[0] = r * cos(angle);
    p[1] = r * sin(angle);
}

struct block {
    uint32_t cells[3];
    bool around;     /* the first axis is closed */
    double hole;     /* cells left out: their share */
    double hollow;   /* cells left out around the middle: their share of the side */
    map_function *map;
    double shape;
};

static void add_cell(struct shape *s, const struct block *b, uint32_t base, const uint32_t cell[3])
{
    static const uint8_t paths[6][2] = {{1, 2}, {2, 1}, {2, 4}, {4, 2}, {4, 1}, {1, 4}};
    uint32_t sides[3], v[8];
    for (int d = 0; d < 3; d++)
        sides[d] = b->cells[d] + !(b->around && d == 0);
    for (uint32_t i = 0; i < 8; i++)
        v[i] = base + (cell[0] + (i & 1)) % sides[0] +
               sides[0] * (cell[1] + (i >> 1 & 1) + sides[1] * (cell[2] + (i >> 2)));
    for (int p = 0; p < 6; p++) {
        uint32_t one = v[paths[p][0]], two = v[paths[p][0] | paths[p][1]];
        add_tet(s, v[0], p % 2 ? two : one, p % 2 ? one : two, v[7]);
    }
}

static void add_block(struct shape *s, struct dice *dice, const struct block *b, uint32_t body, double jitter)
{
    uint32_t base = s->vertices, sides[3], at[3];
    for (int d = 0; d < 3; d++)
        sides[d] = b->cells[d] + !(b->around && d == 0);
    for (at[2] = 0; at[2] < sides[2]; at[2]++)
        for (at[1] = 0; at[1] < sides[1]; at[1]++)
            for (at[0] = 0; at[0] < sides[0]; at[0]++) {
                double p[3];
                for (int d = 0; d < 3; d++) {
                    bool rim = !(b->around && d == 0) && (at[d] == 0 || at[d] == b->cells[d]);
                    p[d] = (at[d] + (rim ? 0 : between(dice, -jitter, jitter))) / b->cells[d];
                }
                b->map(p, b->shape);
                add_vertex(s, p, body);
            }
    uint32_t before = s->tets;
    for (at[2] = 0; at[2] < b->cells[2]; at[2]++)
        for (at[1] = 0; at[1] < b->cells[1]; at[1]++)
            for (at[0] = 0; at[0] < b->cells[0]; at[0]++) {
                bool inner = b->hollow > 0;
                for (int d = 0; d < 3; d++)
                    inner &= fabs((at[d] + 0.5) / b->cells[d] - 0.5) < 0.5 * b->hollow;
                if (!inner && !(dice_unit(dice) < b->hole))
                    add_cell(s, b, base, at);
            }
    if (s->tets == before)
        add_cell(s, b, base, (const uint32_t[3]){0, 0, 0});
}

static void set_cells(struct block *b, struct dice *dice, uint32_t least, uint32_t most)
{
    for (int d = 0; d < 3; d++)
        b->cells[d] = least + dice_below(dice, most - least + 1);
}

static void add_cloud(struct shape *s, struct dice *dice, uint32_t body, bool round)
{
    uint32_t first = s->vertices, count = 12 + dice_below(dice, 110);
    for (uint32_t i = 0; i < count; i++) {
        double p[3], length = 0;
        for (int d = 0; d < 3; d++) {
            p[d] = dice_unit(dice) - 0.5;
            length += p[d] * p[d];
        }
        double to = round && i % 2 && length > 0 ? 0.5 / sqrt(length) : 1;
        for (int d = 0; d < 3; d++)
            p[d] = 0.5 + to * p[d];
        add_vertex(s, p, body);
    }
    shape_delaunay(s, first);
}

/* One body of a kind that tiles what it covers. */
static const char *add_body(struct shape *s, struct dice *dice, uint32_t kind, uint32_t body, uint32_t most)
{
    static const char *const names[] = {"box", "holes", "ball", "shell", "torus", "knot", "plate", "cloud",
                                        "ball cloud"};
    struct block b = {.map = map_box, .shape = between(dice, 0.2, 1)};
    double jitter = dice_once_in(dice, 3) ? 0 : between(dice, 0, 0.25);
    set_cells(&b, dice, 1, most);
    if (kind == 1)
        b.hole = between(dice, 0.1, 0.6);
    if (kind == 2 || kind == 3) {
        uint32_t n = 2 + dice_below(dice, most - 1) / (kind == 2 ? 2 : 1);
        b = (struct block){{n, n, n}, .map = map_ball, .hollow = kind == 3 ? 0.5 : 0};
        jitter = 0;
    }
    if (kind == 4 || kind == 5) {
        b.cells[0] += kind == 4 ? 5 : 14;
        b.cells[1] = b.cells[2] = kind == 4 ? 2 + dice_below(dice, 2) : 1 + dice_below(dice, 2);
        b.around = true;
        b.map = kind == 4 ? map_torus : map_knot;
        jitter *= 0.3;
    }
    if (kind == 6) {
        b.cells[0] += 4;
        b.cells[2] = 1;
        b.map = map_plate;
        jitter *= 0.5;
    }
    if (kind >= 7)
        add_cloud(s, dice, body, kind == 8);
    else
        add_block(s, dice, &b, body, jitter);
    return names[kind];
}

static void move_body(struct shape *s, uint32_t body, const double scale[3], const double by[3])
{
    for (uint32_t v = 0; v < s->vertices; v++)
        for (uint32_t d = 0; d < 3 && s->body[v] == body; d++)
            s->positions[3 * v + d] = by[d] + scale[d] * s->positions[3 * v + d];
}

/* ---- what is wrong with meshes */

static double volume(const struct shape *s, uint32_t t)
{
    const uint32_t *c = s->corners + 4 * t;
    double e[3][3];
    for (uint32_t i = 0; i < 3; i++)
        for (uint32_t d = 0; d < 3; d++)
            e[i][d] = s->positions[3 * c[i + 1] + d] - s->positions[3 * c[0] + d];
    return e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
           e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
}

static void turn_all_positive(struct shape *s)
{
    for (uint32_t t = 0; t < s->tets; t++)
        if (volume(s, t) < 0) {
            uint32_t swap = s->corners[4 * t + 1];
            s->corners[4 * t + 1] = s->corners[4 * t + 2];
            s->corners[4 * t + 2] = swap;
        }
}

/* Moves some vertices far enough to turn tetrahedra inside out. */
static void fold(struct shape *s, struct dice *dice)
{
    uint32_t count = 1 + dice_below(dice, 1 + s->vertices / 12);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = dice_below(dice, s->vertices);
        for (uint32_t d = 0; d < 3; d++)
            s->positions[3 * v + d] += between(dice, -0.6, 0.6);
    }
}

/* Moves some vertices almost, or wholly, onto a neighbour. */
static void squeeze(struct shape *s, struct dice *dice, bool wholly)
{
    uint32_t count = 1 + dice_below(dice, 1 + s->vertices / 10);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *c = s->corners + 4 * dice_below(dice, s->tets);
        uint32_t a = c[dice_below(dice, 4)], b = c[dice_below(dice, 4)];
        double left = wholly ? 0 : pow(10, -between(dice, 1, 9));
        for (uint32_t d = 0; d < 3; d++)
            s->positions[3 * a + d] = s->positions[3 * b + d] + left * (s->positions[3 * a + d] -
                                                                        s->positions[3 * b + d]);
    }
}

/* ---- the whole */

static void two_bodies(struct shape *s, struct dice *dice, bool overlap)
{
    uint32_t kind = dice_below(dice, overlap ? 9 : 2), axis = dice_below(dice, 3);
    double by[3] = {0, 0, 0}, scale[3] = {1, 1, 1};
    for (uint32_t body = 0; body < 2; body++) {
        add_body(s, dice, overlap ? dice_below(dice, 9) : kind, body, 4);
        if (body == 0)
            continue;
        by[axis] = overlap ? between(dice, 0.1, 0.9) : 1;
        for (uint32_t d = 0; d < 3; d++)
            if (d != axis && dice_once_in(dice, 3))
                scale[d] = between(dice, 0.4, 1.5); // a face on part of a face
        move_body(s, 1, scale, by);
    }
}

/* Points of the same place become one vertex, here and there: bodies that share a face, an edge or a point. */
static void join_some(struct shape *s, struct dice *dice)
{
    for (uint32_t v = 0; v < s->vertices; v++)
        for (uint32_t w = 0; w < v; w++)
            if (memcmp(s->positions + 3 * v, s->positions + 3 * w, 3 * sizeof(double)) == 0 && dice_once_in(dice, 3))
                for (uint32_t i = 0; i < 4 * s->tets; i++)
                    s->corners[i] = s->corners[i] == v ? w : s->corners[i];
}

static const char *make_kind(struct shape *s, struct dice *dice)
{
    uint32_t kind = dice_below(dice, 20), most = dice_once_in(dice, 20) ? 8 : 2 + dice_below(dice, 3);
    const double aside[3] = {1.3, 0.2, 0}, same[3] = {1, 1, 1};
    struct block pole = {.map = map_pole, .shape = dice_unit(dice)};
    if (kind < 9)
        return add_body(s, dice, kind, 0, most);
    switch (kind) {
    case 9:
    case 10:
        two_bodies(s, dice, false);
        return "touching bodies";
    case 11:
        two_bodies(s, dice, true);
        return "overlapping bodies";
    case 12:
        two_bodies(s, dice, false);
        join_some(s, dice);
        return "joined bodies";
    case 13:
        add_body(s, dice, dice_below(dice, 9), 0, most);
        fold(s, dice);
        return "folds";
    case 14:
        add_body(s, dice, dice_below(dice, 9), 0, most);
        fold(s, dice);
        turn_all_positive(s);
        return "folds, all positive";
    case 15:
    case 16:
        add_body(s, dice, dice_below(dice, 9), 0, most);
        squeeze(s, dice, kind == 16);
        return kind == 16 ? "coincident points" : "slivers";
    case 17:
        set_cells(&pole, dice, 1, most + 1);
        pole.cells[1] += 3;
        add_block(s, dice, &pole, 0, 0);
        return "pole";
    case 18:
        add_body(s, dice, dice_below(dice, 9), 0, 3);
        add_body(s, dice, dice_below(dice, 9), 1, 3);
        move_body(s, 1, same, aside);
        return "bodies apart";
    default:
        add_body(s, dice, 6, 0, most);
        squeeze(s, dice, false);
        return "plate with slivers";
    }
}

void shape_drop_unused(struct shape *s)
{
    uint32_t kept = 0, *to = calloc(s->vertices, sizeof *to);
    if (!to)
        exit(2);
    for (uint32_t i = 0; i < 4 * s->tets; i++)
        to[s->corners[i]] = 1;
    for (uint32_t v = 0; v < s->vertices; v++) {
        if (!to[v])
            continue;
        memmove(s->positions + 3 * kept, s->positions + 3 * v, 3 * sizeof(double));
        s->body[kept] = s->body[v];
        for (uint32_t f = 0; f < s->field_count; f++) {
            size_t n = s->fields[f].components;
            memmove(s->fields[f].values + n * kept, s->fields[f].values + n * v, n * sizeof(double));
        }
        to[v] = kept++;
    }
    for (uint32_t i = 0; i < 4 * s->tets; i++)
        s->corners[i] = to[s->corners[i]];
    s->vertices = kept;
    free(to);
}

uint32_t shape_copy_vertex(struct shape *s, uint32_t v)
{
    uint32_t copy = s->vertices++;
    if (copy == SHAPE_MAX_VERTICES)
        exit(2);
    memcpy(s->positions + 3 * copy, s->positions + 3 * v, 3 * sizeof(double));
    s->body[copy] = s->body[v];
    for (uint32_t f = 0; f < s->field_count; f++) {
        struct shape_field *field = &s->fields[f];
        size_t n = field->components;
        double *grown = realloc(field->values, s->vertices * n * sizeof *grown);
        if (!grown)
            exit(2);
        field->values = grown;
        memcpy(grown + n * copy, grown + n * v, n * sizeof *grown);
    }
    return copy;
}

/* Tetrahedra that join a vertex with itself (after bodies were joined) are none. */
static void drop_collapsed(struct shape *s)
{
    uint32_t kept = 0;
    for (uint32_t t = 0; t < s->tets; t++) {
        uint32_t c[4];
        memcpy(c, s->corners + 4 * t, sizeof c);
        if (c[0] != c[1] && c[0] != c[2] && c[0] != c[3] && c[1] != c[2] && c[1] != c[3] && c[2] != c[3])
            memcpy(s->corners + 4 * kept++, c, sizeof c);
    }
    s->tets = kept;
}

/* Stretches, turns, scales and moves the whole, and rounds it. */
static void place(struct shape *s, struct dice *dice)
{
    double scale = dice_once_in(dice, 3) ? pow(10, between(dice, -6, 6)) : 1, stretch[3] = {1, 1, 1},
           offset[3] = {0, 0, 0};
    double angle = dice_once_in(dice, 2) ? 2 * PI * dice_unit(dice) : 0;
    s->wide = dice_once_in(dice, 2);
    if (dice_once_in(dice, 5))
        stretch[dice_below(dice, 3)] = pow(10, -between(dice, 0.5, 4));
    if (dice_once_in(dice, 5))
        for (int d = 0; d < 3; d++)
            offset[d] = scale * pow(10, s->wide ? between(dice, 1, 10) : between(dice, 0, 3));
    for (uint32_t v = 0; v < s->vertices; v++) {
        double *p = s->positions + 3 * v, x = p[0], y = p[2];
        p[0] = cos(angle) * x - sin(angle) * y;
        p[2] = sin(angle) * x + cos(angle) * y;
        for (int d = 0; d < 3; d++) {
            p[d] = offset[d] + scale * stretch[d] * p[d];
            p[d] = s->wide ? p[d] : (double)(float)p[d];
        }
    }
}

/* ---- fields */

static double field_value(uint32_t kind, const double p[3], uint32_t body, const double a[6], struct dice *dice)
{
    double x = p[0], y = p[1], z = p[2], r = sqrt(x * x + y * y + z * z);
    switch (kind) {
    case 0:
        return a[0] * x + a[1] * y + a[2] * z;
    case 1:
        return x * y * z;
    case 2:
        return sin(7 * a[0] * x + a[3]) * cos(6 * a[1] * y) + sin(5 * a[2] * z);
    case 3:
        return dice_unit(dice);
    case 4:
        return a[0] * x + a[1] * y + a[2] * z > a[3] ? 1 : 0;
    case 5:
        return exp(-20 * ((x - a[3]) * (x - a[3]) + (y - a[4]) * (y - a[4]) + (z - a[5]) * (z - a[5])));
    case 6:
        return body;
    case 7:
        return floor(4 * r) / 4;
    case 8:
        return a[0] * x + 0.001 * dice_unit(dice);
    case 9:
        return 3;
    default:
        return body + 0.3 * sin(6 * r + a[4]);
    }
}

static void add_field(struct shape *s, struct dice *dice, const double *unit)
{
    static const double offsets[] = {0, 0, 0, 0, 1, -1e4, 1e4, 1e6, -1e9, 1e12};
    struct shape_field *field = &s->fields[s->field_count];
    double a[6], scale = dice_once_in(dice, 3) ? pow(10, between(dice, -20, 20)) : 1;
    snprintf(field->name, sizeof field->name, "f%u", s->field_count++);
    field->components = dice_once_in(dice, 4) ? 1 + dice_below(dice, 3) : 1;
    field->wide = dice_once_in(dice, 2);
    double offset = offsets[dice_below(dice, field->wide ? 10 : 8)];
    field->values = malloc(s->vertices * field->components * sizeof(double));
    if (!field->values)
        exit(2);
    for (uint32_t i = 0; i < field->components; i++) {
        uint32_t kind = dice_below(dice, 25) == 0 ? 9 : dice_below(dice, 11);
        kind = kind == 9 && field->components == 1 ? dice_below(dice, 9) : kind;
        for (int j = 0; j < 6; j++)
            a[j] = between(dice, -1, 1);
        for (uint32_t v = 0; v < s->vertices; v++) {
            double value = scale * (offset + field_value(kind, unit + 3 * v, s->body[v], a, dice));
            field->values[field->components * v + i] = field->wide ? value : (double)(float)value;
        }
    }
}

void shape_make(struct shape *out, struct dice *dice)
{
    *out = (struct shape){.positions = malloc(3 * SHAPE_MAX_VERTICES * sizeof(double)),
                          .corners = malloc(4 * SHAPE_MAX_TETS * sizeof(uint32_t)),
                          .body = malloc(SHAPE_MAX_VERTICES * sizeof(uint32_t))};
    if (!out->positions || !out->corners || !out->body)
        exit(2);
    out->kind = make_kind(out, dice);
    drop_collapsed(out);
    shape_drop_unused(out);
    double *unit = malloc(3 * out->vertices * sizeof *unit);
    if (!unit)
        exit(2);
    memcpy(unit, out->positions, 3 * out->vertices * sizeof *unit);
    place(out, dice);
    uint32_t fields = dice_once_in(dice, 2) ? 1 : 1 + dice_below(dice, 3);
    for (uint32_t f = 0; f < fields; f++)
        add_field(out, dice, unit);
    free(unit);
}

void shape_of_seed(struct shape *out, struct dice *dice, uint64_t seed)
{
    static void (*const makers[])(struct shape *, struct dice *) = {shape_make, shape_make_odd, shape_make_rare};
    size_t kind = seed >= SHAPE_RARE_SEEDS ? 2 : seed >= SHAPE_ODD_SEEDS ? 1 : 0;
    makers[seed >= SHAPE_REGION_SEEDS ? seed % 3 : kind](out, dice);
}

void shape_free(struct shape *shape)
{
    for (uint32_t f = 0; f < shape->field_count; f++)
        free(shape->fields[f].values);
    free(shape->positions);
    free(shape->corners);
    free(shape->body);
    free(shape->region);
    free(shape->marks);
}

void shape_print_finding(const struct shape *shape, uint64_t seed, const char *what, const char *format, va_list list)
{
    printf("seed %" PRIu64 " (%s, %u tets): %s: ", seed, shape->kind, shape->tets, what);
    vprintf(format, list);
}

/* ---- the mesh file */

static void put_big(FILE *file, const void *bytes, int size)
{
    const unsigned char *from = bytes; // written on little-endian machines
    for (int i = size; i-- > 0;)
        fputc(from[i], file);
}

static void put_numbers(FILE *file, const double *values, size_t count, bool wide)
{
    for (size_t i = 0; i < count; i++) {
        float narrow = (float)values[i];
        put_big(file, wide ? (const void *)&values[i] : (const void *)&narrow, wide ? 8 : 4);
    }
    fputc('\n', file);
}

bool shape_write(const struct shape *shape, const char *path)
{
    FILE *file = fopen(path, "wb");
    const uint32_t four = 4, type = 10;
    if (!file)
        return false;
    fprintf(file, "# vtk DataFile Version 3.0\nattack\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS %u %s\n",
            shape->vertices,
            shape->wide ? "double" : "float");
    put_numbers(file, shape->positions, 3 * (size_t)shape->vertices, shape->wide);
    fprintf(file, "CELLS %u %u\n", shape->tets, 5 * shape->tets);
    for (uint32_t t = 0; t < shape->tets; t++) {
        put_big(file, &four, 4);
        for (uint32_t i = 0; i < 4; i++)
            put_big(file, shape->corners + 4 * t + i, 4);
    }
    fprintf(file, "\nCELL_TYPES %u\n", shape->tets);
    for (uint32_t t = 0; t < shape->tets; t++)
        put_big(file, &type, 4);
    if (shape->region || shape->marks)
        fprintf(file, "\nCELL_DATA %u\n", shape->tets);
    if (shape->region)
        fprintf(file, "SCALARS region int 1\nLOOKUP_TABLE default\n");
    for (uint32_t t = 0; t < shape->tets && shape->region; t++)
        put_big(file, shape->region + t, 4);
    if (shape->marks)
        fprintf(file, "%sSCALARS " SHAPE_MARK " double 1\nLOOKUP_TABLE default\n", shape->region ? "\n" : "");
    for (uint32_t t = 0; t < shape->tets && shape->marks; t++) {
        double mark = shape->marks[t];
        put_big(file, &mark, 8);
    }
    fprintf(file, "\nPOINT_DATA %u\nFIELD FieldData %u\n", shape->vertices, shape->field_count);
    for (uint32_t f = 0; f < shape->field_count; f++) {
        const struct shape_field *field = &shape->fields[f];
        fprintf(file, "%s %u %u %s\n", field->name, field->components, shape->vertices,
                field->wide ? "double" : "float");
        put_numbers(file, field->values, (size_t)field->components * shape->vertices, field->wide);
    }
    return fclose(file) == 0;
}
