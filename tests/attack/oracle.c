/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The overlay. On the intersection of an original tetrahedron and one of the level's the difference is linear, so it is
 * largest at a corner, an end of an edge of the one clipped to the other. Doubles rule out what cannot be the largest;
 * what is left is clipped in 113 bits, so that no figure is larger than the truth by more than 1e-25 of it.
 */
#include "tests/attack/oracle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static quad magnitude(quad x)
{
    return x < 0 ? -x : x;
}

void *oracle_memory(size_t count, size_t size)
{
    void *memory = calloc(count + 1, size);
    if (!memory)
        exit(2);
    return memory;
}

static void edges_of(const double *positions, const uint32_t corners[4], quad e[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++)
            e[i][d] = (quad)positions[3 * (size_t)corners[i + 1] + (size_t)d] - positions[3 * (size_t)corners[0] +
                                                                                          (size_t)d];
}

static void cross(const quad a[3], const quad b[3], quad out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static quad dot(const quad a[3], const quad b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static quad six_volumes(const quad e[3][3])
{
    quad n[3];
    cross(e[1], e[2], n);
    return dot(e[0], n);
}

static double longest_edge(const double *positions, const uint32_t corners[4])
{
    double most = 0;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++) {
            double sum = 0;
            for (int d = 0; d < 3; d++) {
                double by = positions[3 * (size_t)corners[i] + (size_t)d] - positions[3 * (size_t)corners[j] +
                                                                                      (size_t)d];
                sum += by * by;
            }
            most = fmax(most, sum);
        }
    return sqrt(most);
}

/* Six volumes as a fraction of the cube of the longest edge. */
static double relative_volume(const double *positions, const uint32_t corners[4])
{
    quad e[3][3];
    double h = longest_edge(positions, corners);
    edges_of(positions, corners, e);
    return h > 0 ? (double)(six_volumes((const quad(*)[3])e) / ((quad)h * h * h)) : 0;
}

int oracle_turn(const double *positions, const uint32_t *corners, uint32_t tets)
{
    quad sum = 0, e[3][3];
    for (uint32_t t = 0; t < tets; t++) {
        edges_of(positions, corners + 4 * (size_t)t, e);
        sum += six_volumes((const quad(*)[3])e);
    }
    return sum < 0 ? -1 : 1;
}

int oracle_sign(const struct oracle_mesh *mesh, uint32_t tet, double *flatness)
{
    double v = mesh->turn * relative_volume(mesh->positions, mesh->corners + 4 * (size_t)tet);
    if (flatness)
        *flatness = fabs(v);
    return v > 1e-9 ? 1 : v < -1e-9 ? -1 : 0;
}

/* On which side of a face is its tetrahedron: the parity of the corner opposite to the sorted face. */
static int side_of(const struct oracle_mesh *mesh, const struct oracle_face *face)
{
    const uint32_t *c = mesh->corners + 4 * (size_t)face->tet;
    uint32_t other = 0;
    for (int i = 0; i < 4; i++)
        if (c[i] != face->v[0] && c[i] != face->v[1] && c[i] != face->v[2])
            other = c[i];
    quad e[3][3];
    edges_of(mesh->positions, (const uint32_t[4]){face->v[0], face->v[1], face->v[2], other}, e);
    quad v = six_volumes((const quad(*)[3])e);
    return v > 0 ? 1 : v < 0 ? -1 : 0;
}

/* Neighbours on the same side of their common face overlap: a fold. Where both are positive one cannot tell which is
 * inside out. */
void oracle_leave_out_folds(struct oracle_mesh *mesh)
{
    bool *folded = oracle_memory(mesh->tets, 1);
    struct oracle_face *faces = oracle_faces(mesh);
    for (size_t i = 0; i + 1 < 4 * (size_t)mesh->tets; i++) {
        if (!oracle_same_face(&faces[i], &faces[i + 1]))
            continue;
        uint32_t t = faces[i].tet, u = faces[i + 1].tet;
        if (mesh->details[t].usable && mesh->details[u].usable &&
            side_of(mesh, &faces[i]) == side_of(mesh, &faces[i + 1]))
            folded[t] = folded[u] = true;
    }
    for (uint32_t t = 0; t < mesh->tets; t++)
        mesh->details[t].usable &= !folded[t];
    free(folded);
    free(faces);
}

static void invert(const struct oracle_mesh *mesh, uint32_t t, struct oracle_tet *out)
{
    quad e[3][3], n[3];
    edges_of(mesh->positions, mesh->corners + 4 * (size_t)t, e);
    quad v = six_volumes((const quad(*)[3])e);
    for (int i = 0; i < 3; i++) {
        cross(e[(i + 1) % 3], e[(i + 2) % 3], n);
        for (int d = 0; d < 3; d++) {
            out->to_weights[3 * i + d] = n[d] / v;
            out->to_weights_near[3 * i + d] = (double)out->to_weights[3 * i + d];
        }
    }
}

void oracle_prepare(struct oracle_mesh *mesh)
{
    mesh->details = oracle_memory(mesh->tets, sizeof *mesh->details);
    for (uint32_t t = 0; t < mesh->tets; t++) {
        struct oracle_tet *tet = &mesh->details[t];
        double flatness;
        tet->usable = oracle_sign(mesh, t, &flatness) > 0 && flatness > 2e-9;
        tet->solid = flatness > 2e-9;
        if (tet->solid)
            invert(mesh, t, tet);
        for (size_t d = 0; d < 3; d++) {
            tet->low[d] = INFINITY;
            tet->high[d] = -INFINITY;
            for (size_t i = 0; i < 4; i++) {
                double x = mesh->positions[3 * (size_t)mesh->corners[4 * (size_t)t + i] + d];
                tet->low[d] = fmin(tet->low[d], x);
                tet->high[d] = fmax(tet->high[d], x);
            }
        }
    }
}

void oracle_finish(struct oracle_mesh *mesh)
{
    free(mesh->details);
    mesh->details = NULL;
}

void oracle_weights(const struct oracle_mesh *mesh, uint32_t tet, const quad x[3], quad weights[4])
{
    const double *a = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet];
    const quad r[3] = {x[0] - a[0], x[1] - a[1], x[2] - a[2]};
    weights[0] = 1;
    for (int i = 0; i < 3; i++)
        weights[0] -= weights[i + 1] = dot(mesh->details[tet].to_weights + 3 * i, r);
}

static void near_weights(const struct oracle_mesh *mesh, uint32_t tet, const double x[3], double weights[4])
{
    const double *a = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet];
    const double *m = mesh->details[tet].to_weights_near, r[3] = {x[0] - a[0], x[1] - a[1], x[2] - a[2]};
    weights[0] = 1;
    for (int i = 0; i < 3; i++)
        weights[0] -= weights[i + 1] = m[3 * i] * r[0] + m[3 * i + 1] * r[1] + m[3 * i + 2] * r[2];
}

static double value_of(const struct oracle_mesh *mesh, uint32_t tet, uint32_t corner, uint32_t i)
{
    return mesh->values[i][(size_t)mesh->corners[4 * (size_t)tet + corner] * mesh->strides[i]];
}

/* Values are taken relative to `base`, exactly: a field far from 0 loses nothing. */
static quad value_by(const struct oracle_mesh *mesh, uint32_t tet, const quad weights[4], uint32_t i, double base)
{
    quad sum = 0;
    for (uint32_t c = 0; c < 4; c++)
        sum += weights[c] * ((quad)value_of(mesh, tet, c, i) - base);
    return sum;
}

/* ---- a pair */

struct pair {
    const struct oracle_mesh *meshes[2];
    uint32_t tets[2];
    struct oracle_place *worst;
    double radius;
    double near[2][4][4];  /* near[m][c]: weights of corner c of tetrahedron m in the other one */
    quad corners[24][3];   /* of the intersection */
    uint32_t count;
    quad centre[3];
};

static const double *position_of(const struct pair *p, int m, uint32_t corner)
{
    return p->meshes[m]->positions + 3 * (size_t)p->meshes[m]->corners[4 * (size_t)p->tets[m] + corner];
}

static bool boxes_meet(const struct oracle_tet *a, const struct oracle_tet *b)
{
    return a->low[0] < b->high[0] && b->low[0] < a->high[0] && a->low[1] < b->high[1] && b->low[1] < a->high[1] &&
           a->low[2] < b->high[2] && b->low[2] < a->high[2];
}

/* Does a face of one have all of the other behind it? */
static bool apart(struct pair *p)
{
    for (int m = 0; m < 2; m++) {
        for (uint32_t c = 0; c < 4; c++)
            near_weights(p->meshes[!m], p->tets[!m], position_of(p, m, c), p->near[m][c]);
        for (int face = 0; face < 4; face++) {
            double most = -INFINITY;
            for (int c = 0; c < 4; c++)
                most = fmax(most, p->near[m][c][face]);
            if (most <= 1e-10)
                return true;
        }
    }
    return false;
}

/* The difference in the intersection is no larger than at the corners of either tetrahedron. */
static bool may_be_worst(const struct pair *p, uint32_t i)
{
    double bound = INFINITY, base = value_of(p->meshes[0], p->tets[0], 0, i);
    for (int m = 0; m < 2; m++) {
        double most = 0;
        for (uint32_t c = 0; c < 4; c++) {
            double other = 0;
            for (uint32_t k = 0; k < 4; k++)
                other += p->near[m][c][k] * (value_of(p->meshes[!m], p->tets[!m], k, i) - base);
            most = fmax(most, fabs(value_of(p->meshes[m], p->tets[m], c, i) - base - other));
        }
        bound = fmin(bound, most);
    }
    return bound * (1 + 1e-6) > p->worst[i].difference;
}

/* The part of edge (a, b) of tetrahedron m inside the other one, of which the weights of a and b are given. */
static void clip_edge(struct pair *p, int m, uint32_t a, uint32_t b, quad w[4][4])
{
    quad low = 0, high = 1;
    for (int face = 0; face < 4; face++) {
        quad from = w[a][face], to = w[b][face];
        if (from < 0 && to < 0)
            return;
        if (from < 0 && from / (from - to) > low)
            low = from / (from - to);
        if (to < 0 && from / (from - to) < high)
            high = from / (from - to);
    }
    for (int end = 0; end < 2 && low <= high; end++) {
        quad t = end ? high : low;
        for (int d = 0; d < 3; d++)
            p->corners[p->count][d] = position_of(p, m,
                                                  a)[d] + t * ((quad)position_of(p, m, b)[d] - position_of(p, m, a)[d]);
        p->count++;
    }
}

/* The intersection's corners; false: they touch at most. */
static bool clip(struct pair *p)
{
    p->count = 0;
    for (int m = 0; m < 2; m++) {
        quad w[4][4];
        for (uint32_t c = 0; c < 4; c++) {
            const double *x = position_of(p, m, c);
            oracle_weights(p->meshes[!m], p->tets[!m], (const quad[3]){x[0], x[1], x[2]}, w[c]);
            for (int k = 0; k < 4; k++) // what lies in a face's plane belongs to the face
                w[c][k] = magnitude(w[c][k]) < 1e-20 ? 0 : w[c][k];
        }
        for (uint32_t a = 0; a < 4; a++)
            for (uint32_t b = 0; b < a; b++)
                clip_edge(p, m, a, b, w);
    }
    memset(p->centre, 0, sizeof p->centre);
    for (uint32_t k = 0; k < p->count; k++)
        for (int d = 0; d < 3; d++)
            p->centre[d] += p->corners[k][d] / p->count;
    for (int m = 0; m < 2 && p->count; m++) {
        quad w[4];
        oracle_weights(p->meshes[m], p->tets[m], p->centre, w);
        for (int i = 0; i < 4; i++)
            if (w[i] < 1e-9)
                return false;
    }
    return p->count > 0;
}

static quad difference_in(const struct oracle_mesh *level, uint32_t tet, const quad x[3], uint32_t i, double base,
                          quad value)
{
    quad w[4];
    oracle_weights(level, tet, x, w);
    return magnitude(value_by(level, tet, w, i, base) - value);
}

static bool box_holds(const struct oracle_tet *tet, const double x[3])
{
    for (int d = 0; d < 3; d++)
        if (x[d] < tet->low[d] || x[d] > tet->high[d])
            return false;
    return true;
}

static uint32_t part_of(const struct oracle_mesh *mesh, uint32_t tet)
{
    return mesh->part[mesh->corners[4 * (size_t)tet]];
}

/* Does a tetrahedron that is not flat, of the part, hold x? Sets x's weights. */
static bool holds(const struct oracle_mesh *mesh, uint32_t tet, uint32_t part, const quad x[3], quad weights[4])
{
    const double near[3] = {(double)x[0], (double)x[1], (double)x[2]};
    if (!mesh->details[tet].solid || part_of(mesh, tet) != part || !box_holds(&mesh->details[tet], near))
        return false;
    oracle_weights(mesh, tet, x, weights);
    return weights[0] >= 0 && weights[1] >= 0 && weights[2] >= 0 && weights[3] >= 0;
}

/* Another tetrahedron of the level that holds x may be nearer to the truth. */
static quad best_of_others(const struct pair *p, const quad x[3], uint32_t i, double base, quad value, quad best)
{
    const struct oracle_mesh *level = p->meshes[1];
    for (uint32_t t = 0; t < level->tets; t++) {
        quad w[4];
        if (t == p->tets[1] || !level->details[t].usable || !holds(level, t, part_of(level, p->tets[1]), x, w))
            continue;
        quad here = magnitude(value_by(level, t, w, i, base) - value);
        best = here < best ? here : best;
    }
    return best;
}

/* Does a tetrahedron of the original beside the pair's hold x, too? */
static bool overlaps_itself(const struct pair *p, const quad x[3])
{
    const struct oracle_mesh *original = p->meshes[0];
    quad w[4];
    for (uint32_t t = 0; t < original->tets; t++)
        if (t != p->tets[0] && holds(original, t, part_of(original, p->tets[0]), x, w))
            return true;
    return false;
}

/* The difference at corner k, or a hair inside of it where the level covers that more than once. */
static void try_corner(struct pair *p, uint32_t k, uint32_t i)
{
    double base = value_of(p->meshes[0], p->tets[0], 0, i);
    quad w[4], x[3];
    oracle_weights(p->meshes[0], p->tets[0], p->corners[k], w);
    quad value = value_by(p->meshes[0], p->tets[0], w, i, base);
    quad found = difference_in(p->meshes[1], p->tets[1], p->corners[k], i, base, value);
    if (found <= p->worst[i].difference)
        return;
    for (int d = 0; d < 3; d++)
        x[d] = p->corners[k][d] + 1e-7 * (p->centre[d] - p->corners[k][d]);
    oracle_weights(p->meshes[0], p->tets[0], x, w);
    quad inside = value_by(p->meshes[0], p->tets[0], w, i, base);
    quad here = difference_in(p->meshes[1], p->tets[1], x, i, base, inside);
    quad best = best_of_others(p, x, i, base, inside, here);
    found = best < here ? best : found;
    if (found > p->worst[i].difference && overlaps_itself(p, x)) {
        const double near[3] = {(double)x[0], (double)x[1], (double)x[2]};
        found = fmin((double)found,
                     oracle_least_near(p->meshes[1], part_of(p->meshes[1], p->tets[1]), near, p->radius, i,
                                       inside + base, p->worst[i].difference));
    }
    if (found <= p->worst[i].difference)
        return;
    p->worst[i] = (struct oracle_place){.value = (double)(value + base), .difference = (double)found,
                                        .tet = p->tets[0]};
    for (int d = 0; d < 3; d++)
        p->worst[i].position[d] = (double)p->corners[k][d];
}

static void try_pair(struct pair *p)
{
    uint32_t wanted[ORACLE_MAX_VALUES], count = 0;
    if (apart(p))
        return;
    for (uint32_t i = 0; i < p->meshes[0]->value_count; i++)
        if (may_be_worst(p, i))
            wanted[count++] = i;
    if (!count || !clip(p))
        return;
    for (uint32_t j = 0; j < count; j++)
        for (uint32_t k = 0; k < p->count; k++)
            try_corner(p, k, wanted[j]);
}

void oracle_overlay(const struct oracle_mesh *original, const struct oracle_mesh *level, double radius,
                    struct oracle_place worst[ORACLE_MAX_VALUES])
{
    memset(worst, 0, ORACLE_MAX_VALUES * sizeof *worst);
    oracle_overlay_above(original, level, radius, worst);
}

void oracle_overlay_above(const struct oracle_mesh *original, const struct oracle_mesh *level, double radius,
                          struct oracle_place worst[ORACLE_MAX_VALUES])
{
    struct pair p = {.meshes = {original, level}, .worst = worst, .radius = radius};
    for (p.tets[0] = 0; p.tets[0] < original->tets; p.tets[0]++) {
        const struct oracle_tet *a = &original->details[p.tets[0]];
        uint32_t part = part_of(original, p.tets[0]);
        for (p.tets[1] = 0; p.tets[1] < level->tets && a->usable; p.tets[1]++) {
            const struct oracle_tet *b = &level->details[p.tets[1]];
            if (b->usable && (!level->wanted || level->wanted[p.tets[1]]) && boxes_meet(a, b) &&
                part_of(level, p.tets[1]) == part)
                try_pair(&p);
        }
    }
}

bool oracle_touches(const struct oracle_mesh *mesh, uint32_t part, const double point[3])
{
    for (uint32_t t = 0; t < mesh->tets; t++) {
        double w[4];
        bool corner = false;
        for (int c = 0; c < 4; c++)
            corner |= memcmp(mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)t + (size_t)c], point,
                             3 * sizeof *point) == 0;
        if (corner || !mesh->details[t].usable || part_of(mesh, t) != part)
            continue;
        near_weights(mesh, t, point, w);
        if (fmin(fmin(w[0], w[1]), fmin(w[2], w[3])) >= -1e-9)
            return true;
    }
    return false;
}

bool oracle_difference_at(const struct oracle_mesh *level, uint32_t part, const double point[3], uint32_t i,
                          double value, double *out)
{
    *out = INFINITY;
    bool held = false;
    for (uint32_t t = 0; t < level->tets; t++) {
        double w[4], sum = 0;
        const struct oracle_tet *tet = &level->details[t];
        bool out_of_box = false;
        for (int d = 0; d < 3; d++) {
            double room = 1e-9 * (tet->high[d] - tet->low[d]);
            out_of_box |= point[d] < tet->low[d] - room || point[d] > tet->high[d] + room;
        }
        if (out_of_box || part_of(level, t) != part)
            continue;
        if (!tet->usable) { // it may hold the point, but has no value there
            held = true;
            *out = 0;
            continue;
        }
        near_weights(level, t, point, w);
        if (fmin(fmin(w[0], w[1]), fmin(w[2], w[3])) < -1e-9)
            continue;
        for (uint32_t c = 0; c < 4; c++)
            sum += w[c] * (value_of(level, t, c, i) - value);
        held = true;
        *out = fmin(*out, fabs(sum));
    }
    return held;
}
