/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/moved_boundary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/util/array.h"

/* What rounding makes of distances. */
static const double ROUNDING = 1e-9;

static const double *corner(const struct moved_boundary *boundary, uint32_t face, int c)
{
    return boundary->positions + 3 * (size_t)boundary->faces[3 * (size_t)face + (size_t)c];
}

/* The volume of all that is no further from a triangle than r: a prism, parts of cylinders and of a ball. */
static double volume_around(const double *a, const double *b, const double *c, double r)
{
    static const double PI = 3.14159265358979324;
    double ab = sqrt(distance_squared(a, b)), bc = sqrt(distance_squared(b, c)), ca = sqrt(distance_squared(c, a));
    double u[3], v[3];
    for (int i = 0; i < 3; i++) {
        u[i] = b[i] - a[i];
        v[i] = c[i] - a[i];
    }
    double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
    return r * sqrt(x * x + y * y + z * z) + PI * r * r * (ab + bc + ca) / 2 + 4 * PI * r * r * r / 3;
}

static void list_faces(struct moved_boundary *out, const struct tetmesh *mesh, const uint32_t *neighbours)
{
    for (size_t t = 0; t < mesh->tet_count; t++)
        for (size_t f = 0; f < 4; f++) {
            if (neighbours[4 * t + f] != TETLOD_NONE)
                continue;
            for (size_t c = 0; c < 3; c++)
                out->faces[3 * (size_t)out->count + c] = mesh->corners[4 * t + tet_faces[f][c]];
            out->count++;
        }
}

enum tetlod_status moved_boundary_find(struct moved_boundary *out, const struct tetmesh *mesh,
                                       const uint32_t *neighbours, double moved, struct tetlod_error *error)
{
    size_t count = 0;
    for (size_t i = 0; i < 4 * (size_t)mesh->tet_count; i++)
        count += neighbours[i] == TETLOD_NONE;
    *out = (struct moved_boundary){.positions = mesh->positions, .faces = array_new(count, 3 * sizeof(uint32_t)),
                           .moved = moved * (1 + ROUNDING)};
    if (!out->faces)
        return tetlodi_fail_nomem(error, "the boundary", count * 3 * sizeof(uint32_t));
    list_faces(out, mesh, neighbours);
    for (uint32_t f = 0; f < out->count; f++)
        out->shell += volume_around(corner(out, f, 0), corner(out, f, 1), corner(out, f, 2), out->moved);
    out->shell *= 1 + ROUNDING;
    return bvh_build(&out->tree, mesh->positions, out->faces, out->count, 3, BVH_LEAF, error);
}

void moved_boundary_fini(struct moved_boundary *boundary)
{
    free(boundary->faces);
    bvh_fini(&boundary->tree);
    *boundary = (struct moved_boundary){0};
}

static void widen(const double box[6], double by, double out[6])
{
    for (int i = 0; i < 3; i++) {
        out[i] = box[i] - by;
        out[i + 3] = box[i + 3] + by;
    }
}

/* Does a triangle's plane, or its box, keep it away from a box? */
static bool is_apart(const struct moved_boundary *boundary, uint32_t face, const double box[6])
{
    const double *a = corner(boundary, face, 0), *b = corner(boundary, face, 1), *c = corner(boundary, face, 2);
    double at = 0, size = 0, normal[3];
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        normal[i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
        if (larger(larger(a[i], b[i]), c[i]) < box[i] || smaller(smaller(a[i], b[i]), c[i]) > box[i + 3])
            return true;
    }
    for (int i = 0; i < 3; i++) {
        at += normal[i] * ((box[i] + box[i + 3]) / 2 - a[i]);
        size += fabs(normal[i]) * (box[i + 3] - box[i]) / 2;
    }
    return fabs(at) > size * (1 + ROUNDING);
}

bool moved_boundary_leaves_box(const struct moved_boundary *boundary, const double box[6])
{
    double wide[6];
    uint32_t first, end;
    widen(box, boundary->moved, wide);
    struct bvh_walk walk = bvh_walk_begin(&boundary->tree);
    while (boundary->count && bvh_next_leaf(&walk, wide, &first, &end))
        for (uint32_t i = first; i < end; i++)
            if (!is_apart(boundary, boundary->tree.order[i], wide))
                return false;
    return true;
}

bool moved_boundary_leaves(const struct moved_boundary *boundary, const double place[3])
{
    const double box[6] = {place[0], place[1], place[2], place[0], place[1], place[2]};
    double wide[6], weights[3];
    uint32_t first, end;
    if (!boundary->count)
        return true;
    widen(box, boundary->moved, wide);
    struct bvh_walk walk = bvh_walk_begin(&boundary->tree);
    while (bvh_next_leaf(&walk, wide, &first, &end))
        for (uint32_t i = first; i < end; i++) {
            uint32_t face = boundary->tree.order[i];
            const double *a = corner(boundary, face, 0), *b = corner(boundary, face, 1), *c = corner(boundary, face, 2);
            if (triangle_distance2(place, a, b, c, weights) <= boundary->moved * boundary->moved)
                return false;
        }
    return true;
}
