/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/diff/moved_boundary.h"

#include <math.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/mesh/vector.h"

/* What rounding makes of distances. */
static const double ROUNDING = 1e-9;

static const double *corner(const struct moved_boundary *boundary, uint32_t face, int c)
{
    return boundary->surface.positions + 3 * (size_t)boundary->surface.triangles[3 * (size_t)face + (size_t)c];
}

/* The volume of all that is no further from a triangle than r: a prism, parts of cylinders and of a ball. */
static double volume_around(const double *a, const double *b, const double *c, double r)
{
    static const double PI = 3.14159265358979324;
    double ab = sqrt(distance_squared(a, b)), bc = sqrt(distance_squared(b, c)), ca = sqrt(distance_squared(c, a));
    double normal[3]; // twice the area long
    triangle_cross(a, b, c, normal);
    return r * sqrt(dot(normal, normal)) + PI * r * r * (ab + bc + ca) / 2 + 4 * PI * r * r * r / 3;
}

enum tetlod_status moved_boundary_find(struct moved_boundary *out, const struct tetmesh *mesh,
                                       const uint32_t *neighbours, double moved, struct tetlod_error *error)
{
    *out = (struct moved_boundary){.moved = moved * (1 + ROUNDING)};
    TETLOD_TRY(mesh_surface_init(&out->surface, mesh->positions, mesh->corners, neighbours, mesh->tet_count, NULL, 0, 0,
                                 error));
    for (uint32_t f = 0; f < out->surface.count; f++)
        out->shell += volume_around(corner(out, f, 0), corner(out, f, 1), corner(out, f, 2), out->moved);
    out->shell *= 1 + ROUNDING;
    return TETLOD_OK;
}

void moved_boundary_fini(struct moved_boundary *boundary)
{
    mesh_surface_fini(&boundary->surface);
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
    triangle_cross(a, b, c, normal);
    for (int i = 0; i < 3; i++) {
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
    struct bvh_walk walk = bvh_walk_begin(&boundary->surface.boxes);
    while (boundary->surface.count && bvh_next_leaf(&walk, wide, &first, &end))
        for (uint32_t i = first; i < end; i++)
            if (!is_apart(boundary, boundary->surface.boxes.order[i], wide))
                return false;
    return true;
}

bool moved_boundary_leaves(const struct moved_boundary *boundary, const double place[3])
{
    const double box[6] = {place[0], place[1], place[2], place[0], place[1], place[2]};
    double wide[6], weights[3];
    uint32_t first, end;
    if (!boundary->surface.count)
        return true;
    widen(box, boundary->moved, wide);
    struct bvh_walk walk = bvh_walk_begin(&boundary->surface.boxes);
    while (bvh_next_leaf(&walk, wide, &first, &end))
        for (uint32_t i = first; i < end; i++) {
            uint32_t face = boundary->surface.boxes.order[i];
            const double *a = corner(boundary, face, 0), *b = corner(boundary, face, 1), *c = corner(boundary, face, 2);
            if (triangle_distance2(place, a, b, c, weights) <= boundary->moved * boundary->moved)
                return false;
        }
    return true;
}
