/* SPDX-License-Identifier: BSD-3-Clause */
/* What the recipes of shapes.c leave out: meshes of any scale, layers, and parts that hang together by a vertex, an
 * edge or a face. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/attack/shapes.h"

static void scale_all(struct shape *s, double by)
{
    for (uint32_t i = 0; i < 3 * s->vertices; i++)
        s->positions[i] = s->wide ? s->positions[i] * by : (double)(float)(s->positions[i] * by);
}

/* Layers that get thinner towards one side: by a factor of up to 1e6 over the mesh. */
static void grade(struct shape *s, struct dice *dice)
{
    uint32_t axis = dice_below(dice, 3);
    double low = INFINITY, high = -INFINITY, strength = 3 + 11 * dice_unit(dice);
    for (uint32_t v = 0; v < s->vertices; v++) {
        low = fmin(low, s->positions[3 * v + axis]);
        high = fmax(high, s->positions[3 * v + axis]);
    }
    for (uint32_t v = 0; v < s->vertices && high > low; v++) {
        double *x = &s->positions[3 * v + axis], t = (*x - low) / (high - low);
        *x = low + (high - low) * (exp(strength * t) - 1) / (exp(strength) - 1);
        *x = s->wide ? *x : (double)(float)*x;
    }
}

/* Keeps the first tetrahedra: one, or a few that may hang together by anything. */
static void keep_few(struct shape *s, struct dice *dice, bool at_random)
{
    uint32_t kept = 0, wanted = 1 + dice_below(dice, at_random ? s->tets : 2);
    for (uint32_t t = 0; t < s->tets && kept < wanted; t++)
        if (!at_random || dice_once_in(dice, 3))
            memmove(s->corners + 4 * kept++, s->corners + 4 * t, 4 * sizeof *s->corners);
    s->tets = kept ? kept : 1;
}

/* More than two tetrahedra at some faces: copies of tetrahedra with a corner of their own. */
static void overfill(struct shape *s, struct dice *dice)
{
    uint32_t count = 1 + dice_below(dice, 4);
    for (uint32_t i = 0; i < count && s->vertices < SHAPE_MAX_VERTICES && s->tets < SHAPE_MAX_TETS; i++) {
        uint32_t t = dice_below(dice, s->tets), c = dice_below(dice, 4), *to = s->corners + 4 * s->tets++,
                 from = s->corners[4 * t + c];
        memcpy(to, s->corners + 4 * t, 4 * sizeof *to);
        to[c] = shape_copy_vertex(s, from);
        for (uint32_t d = 0; d < 3; d++) {
            double far = s->positions[3 * s->corners[4 * t + (c + 1) % 4] + d], *x = &s->positions[3 * to[c] + d];
            *x = s->positions[3 * from + d] + 0.3 * (s->positions[3 * from + d] - far);
            *x = s->wide ? *x : (double)(float)*x;
        }
    }
}

void shape_make_odd(struct shape *out, struct dice *dice)
{
    shape_make(out, dice);
    switch (dice_below(dice, 6)) {
    case 0:
        scale_all(out, pow(10, (out->wide ? 60 : 6) * (2 * dice_unit(dice) - 1)));
        out->kind = "any scale";
        break;
    case 1:
    case 2:
        grade(out, dice);
        out->kind = "layers";
        break;
    case 3:
        keep_few(out, dice, false);
        out->kind = "a single one";
        break;
    case 4:
        keep_few(out, dice, true);
        out->kind = "rubble";
        break;
    default:
        overfill(out, dice);
        out->kind = "overfull faces";
    }
    shape_drop_unused(out);
}
