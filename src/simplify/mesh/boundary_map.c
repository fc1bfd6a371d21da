/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/boundary_map.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* Faces of both patches are at least this steep: the cosine of their normals with the direction of the map. */
static const double MIN_SLOPE = 0.2;

/* A direction is good enough if all faces are that steep, and is looked for in so many steps. */
static const double GOOD_SLOPE = 0.9;
enum { MAX_STEPS = 16 };

/* A point whose weight at the result is less than that is on the rim: no value at the result helps there. */
static const double ON_RIM = 1e-12;

void boundary_map_fini(struct boundary_map *map)
{
    free(map->faces);
    free(map->points);
    *map = (struct boundary_map){0};
}

static double cross2(const double a[2], const double b[2])
{
    return a[0] * b[1] - a[1] * b[0];
}

static const double *position(const struct boundary_map *map, uint32_t vertex)
{
    return map->positions + map->stride * vertex;
}

static bool same(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* The face's normal now, or after the contraction. */
static void face_normal(const struct boundary_map *map, const struct map_face *face, bool after, double out[3])
{
    triangle_cross(after ? map->p : position(map, face->corners[0]), position(map, face->corners[1]),
                   position(map, face->corners[2]), out);
}

void boundary_map_begin(struct boundary_map *map, const double *positions, size_t stride, const uint32_t *simplex,
                        uint32_t count,
                        const double p[3])
{
    map->positions = positions;
    map->stride = stride;
    map->simplex_count = count;
    map->face_count = map->point_count = 0;
    memcpy(map->p, p, sizeof map->p);
    for (uint32_t s = 0; s < count; s++) {
        map->simplex[s] = simplex[s];
        map->moves[s] = !same(position(map, simplex[s]), p);
    }
}

void boundary_map_add_face(struct boundary_map *map, const uint32_t corners[4], unsigned opposite)
{
    bool inside[3] = {false, false, false}, moves = false;
    int contracted = 0, first = 0;
    for (int k = 0; k < 3; k++) {
        for (uint32_t s = 0; s < map->simplex_count; s++)
            if (corners[tet_faces[opposite][k]] == map->simplex[s]) {
                inside[k] = true;
                moves |= map->moves[s];
            }
        first = inside[k] ? k : first;
        contracted += inside[k];
    }
    if (!moves)
        return;
    if (!ARRAY_RESERVE(map->faces, map->face_room, map->face_count + 1)) {
        map->failed = true;
        return;
    }
    struct map_face *face = &map->faces[map->face_count++];
    face->vanishes = contracted > 1;
    for (int k = 0; k < 3; k++) {
        face->corners[k] = corners[tet_faces[opposite][(first + k) % 3]];
        face->inside[k] = inside[(first + k) % 3];
    }
}

/* The direction of the map: about the axis of the narrowest cone around the faces' normals, whose steps get shorter.
 * False: a face has no area. */
static bool choose_direction(struct boundary_map *map)
{
    double *d = map->direction;
    d[0] = d[1] = d[2] = 0;
    for (int step = 0; step < MAX_STEPS; step++) {
        double n[3], worst[3] = {0, 0, 0}, least = INFINITY;
        for (uint32_t f = 0; f < map->face_count; f++) {
            face_normal(map, &map->faces[f], false, n);
            double length = sqrt(dot(n, n)), along = dot(n, d) / length;
            if (!(length > 0))
                return false;
            for (int i = 0; i < 3 && along < least; i++)
                worst[i] = n[i] / length;
            least = smaller(least, along);
        }
        if (step && least > GOOD_SLOPE)
            break;
        for (int i = 0; i < 3; i++)
            d[i] += (worst[i] - d[i]) / (step + 1);
        double length = sqrt(dot(d, d));
        for (int i = 0; i < 3; i++)
            d[i] /= length;
    }
    return true;
}

static void choose_axes(struct boundary_map *map)
{
    const double *d = map->direction;
    int least = 0;
    for (int i = 1; i < 3; i++)
        least = fabs(d[i]) < fabs(d[least]) ? i : least;
    double *u = map->axes[0], *v = map->axes[1], size = sqrt(1 - d[least] * d[least]);
    for (int i = 0; i < 3; i++)
        u[i] = ((i == least) - d[least] * d[i]) / size;
    cross(d, u, v);
}

static void flatten(struct boundary_map *map)
{
    for (uint32_t f = 0; f < map->face_count; f++)
        for (int k = 0; k < 3; k++) {
            const double *q = position(map, map->faces[f].corners[k]);
            double r[3] = {q[0] - map->p[0], q[1] - map->p[1], q[2] - map->p[2]};
            for (int i = 0; i < 2; i++)
                map->faces[f].flat[k][i] = dot(map->axes[i], r);
        }
}

/* Does a face lie well over the plane? */
static bool over_plane(const struct boundary_map *map, const double n[3])
{
    double height = dot(n, map->direction);
    return height > 0 && height * height > MIN_SLOPE * MIN_SLOPE * dot(n, n);
}

/* Is the direction in the sector from a to b, which turns left by less than half a turn? At a it is, at b it is not. */
static bool in_sector(const double direction[2], const double a[2], const double b[2])
{
    double from = cross2(a, direction);
    return (from > 0 || (from == 0 && a[0] * direction[0] + a[1] * direction[1] > 0)) && cross2(direction, b) > 0;
}

/* Does the new fan go around the result at most once? Then no sector begins inside another. */
static bool goes_around_once(const struct boundary_map *map)
{
    for (uint32_t f = 0; f < map->face_count; f++)
        for (uint32_t g = 0; g < map->face_count; g++)
            if (f != g && !map->faces[f].vanishes && !map->faces[g].vanishes &&
                in_sector(map->faces[f].flat[1], map->faces[g].flat[1], map->faces[g].flat[2]))
                return false;
    return true;
}

/* Are both patches graphs over the plane, and is the new one a fan that goes around at most once? */
static bool graphs(const struct boundary_map *map, double cosine)
{
    for (uint32_t f = 0; f < map->face_count; f++) {
        const struct map_face *face = &map->faces[f];
        double before[3], after[3];
        face_normal(map, face, false, before);
        if (!over_plane(map, before))
            return false;
        if (face->vanishes)
            continue;
        face_normal(map, face, true, after);
        if (!over_plane(map, after) || dot(before, after) < cosine * sqrt(dot(before, before) * dot(after, after)))
            return false;
        if (!(cross2(face->flat[1], face->flat[2]) > 0))
            return false;
    }
    return goes_around_once(map);
}

/* ---- the overlay's vertices */

/* False: no memory. */
static bool add_point(struct boundary_map *map, struct map_point point)
{
    double sum = 0;
    if (!ARRAY_RESERVE(map->points, map->point_room, map->point_count + 1))
        map->failed = true;
    if (map->failed)
        return false;
    for (int i = 0; i < 3; i++) {
        double d = 0, size = 0, *from = point.from_weights, *to = point.to_weights; // relative to the result
        for (int k = 0; k < 5; k++) {
            double x = position(map, k < 3 ? point.from[k] : point.to[k - 3])[i] - map->p[i];
            double part = k < 3 ? from[k] * x : -to[k - 3] * x;
            d += part;
            size += fabs(part);
        }
        d = fabs(d) + 8 * DBL_EPSILON * size; // it is what is left of larger terms
        sum += d * d;
    }
    point.distance = sqrt(sum);
    map->points[map->point_count++] = point;
    return true;
}

/* Weights that rounding has made negative become 0. */
static void make_convex(double weights[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += weights[k] = larger(weights[k], 0);
    for (int k = 0; k < 3; k++)
        weights[k] /= sum;
}

/* Barycentric weights of a point of the plane in a triangle; their least is returned. */
static double weigh(const double flat[3][2], const double at[2], double weights[3])
{
    double e[3][2];
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 2; i++)
            e[k][i] = flat[k][i] - at[i];
    double area = 0;
    for (int k = 0; k < 3; k++)
        area += weights[k] = cross2(e[(k + 1) % 3], e[(k + 2) % 3]);
    for (int k = 0; k < 3; k++)
        weights[k] /= area;
    return smaller(weights[0], smaller(weights[1], weights[2]));
}

/* A contracted vertex in the new patch. */
static bool map_vertex(struct boundary_map *map, uint32_t vertex, const double flat[2])
{
    struct map_point point = {.from = {vertex, vertex, vertex}, .from_weights = {1, 0, 0}};
    double best = -INFINITY, weights[3];
    for (uint32_t f = 0; f < map->face_count; f++) {
        const struct map_face *face = &map->faces[f];
        const double moved[3][2] = {{0, 0}, {face->flat[1][0], face->flat[1][1]}, {face->flat[2][0], face->flat[2][1]}};
        double least;
        if (face->vanishes || !((least = weigh(moved, flat, weights)) > best))
            continue;
        best = least;
        make_convex(weights);
        point.apex = weights[0];
        for (int k = 0; k < 2; k++) {
            point.to[k] = face->corners[k + 1];
            point.to_weights[k] = weights[k + 1];
        }
    }
    return best > -1e-12 && add_point(map, point);
}

/* The result in the old patch. */
static bool map_result(struct boundary_map *map)
{
    const double origin[2] = {0, 0};
    double best = -INFINITY, weights[3];
    struct map_point point = {.apex = 1};
    for (uint32_t f = 0; f < map->face_count; f++) {
        double least = weigh((const double(*)[2])map->faces[f].flat, origin, weights);
        if (!(least > best))
            continue;
        best = least;
        make_convex(weights);
        for (int k = 0; k < 3; k++) {
            point.from[k] = map->faces[f].corners[k];
            point.from_weights[k] = weights[k];
        }
        point.to[0] = point.to[1] = point.from[0];
    }
    return best > -1e-12 && add_point(map, point);
}

/* Vertices that are contracted and move, each from the first face that has it; and the result, if it is none of
 * them. */
static bool map_vertices(struct boundary_map *map)
{
    bool result = true;
    for (uint32_t s = 0; s < map->simplex_count; s++) {
        bool found = false;
        result &= map->moves[s];
        for (uint32_t f = 0; f < map->face_count && map->moves[s] && !found; f++)
            for (int k = 0; k < 3 && !found; k++) {
                found = map->faces[f].corners[k] == map->simplex[s];
                if (found && !map_vertex(map, map->simplex[s], map->faces[f].flat[k]))
                    return false;
            }
    }
    return !result || map_result(map);
}

/* Where an old edge from a to b crosses the new one from the result to x. */
static bool map_crossing(struct boundary_map *map, const struct map_face *old, int k, const struct map_face *new)
{
    const double *a = old->flat[k], *b = old->flat[(k + 1) % 3], *x = new->flat[1];
    double side_a = cross2(x, a), side_b = cross2(x, b);
    if (!((side_a < 0 && side_b > 0) || (side_a > 0 && side_b < 0)))
        return true;
    double t = side_a / (side_a - side_b), c[2] = {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])};
    double s = (c[0] * x[0] + c[1] * x[1]) / (x[0] * x[0] + x[1] * x[1]);
    if (!(s > 0 && s < 1))
        return true;
    uint32_t from = old->corners[k], end = old->corners[(k + 1) % 3];
    return add_point(map, (struct map_point){.from = {from, end, end},
                                             .from_weights = {1 - t, t, 0},
                                             .to = {new->corners[1], new->corners[1]},
                                             .apex = 1 - s,
                                             .to_weights = {s, 0}});
}

/* All crossings. An edge inside the old patch is in two faces: it is taken where it runs up, one at the rim is taken or
 * not. */
static bool map_crossings(struct boundary_map *map)
{
    for (uint32_t f = 0; f < map->face_count; f++)
        for (int k = 0; k < 3; k++) {
            const struct map_face *old = &map->faces[f];
            uint32_t from = old->corners[k], end = old->corners[(k + 1) % 3];
            if (from > end || !(old->inside[k] || old->inside[(k + 1) % 3]))
                continue;
            for (uint32_t g = 0; g < map->face_count; g++)
                if (!map->faces[g].vanishes && !map_crossing(map, old, k, &map->faces[g]))
                    return false;
        }
    return true;
}

bool boundary_map_find(struct boundary_map *map, double cosine)
{
    if (map->failed)
        return false;
    if (!map->face_count)
        return true;
    if (!choose_direction(map))
        return false;
    choose_axes(map);
    flatten(map);
    return graphs(map, cosine) && map_vertices(map) && map_crossings(map);
}

/* What the result's value must be, from above (sign 1) or below (-1), widened by the rounding of doing so. */
static double extreme(const struct boundary_map *map, const double *values, size_t stride, double per_distance,
                      double sign)
{
    double extreme = -INFINITY;
    for (uint32_t i = 0; i < map->point_count; i++) {
        const struct map_point *at = &map->points[i];
        double base = values[stride * at->from[0]], needed = per_distance * at->distance, size = needed;
        for (int k = 0; k < 5; k++) {
            double weight = k < 3 ? at->from_weights[k] : -at->to_weights[k - 3];
            double part = weight * (values[stride * (k < 3 ? at->from[k] : at->to[k - 3])] - base) * sign;
            needed += part;
            size += fabs(part);
        }
        needed += 16 * DBL_EPSILON * size;
        if (at->apex < ON_RIM && needed <= 0)
            continue;
        double rise = at->apex < ON_RIM ? INFINITY : needed / at->apex;
        extreme = larger(extreme, sign * base + rise + 2 * DBL_EPSILON * (fabs(base) + fabs(rise)));
    }
    return sign * extreme;
}

double boundary_map_least(const struct boundary_map *map, const double *values, size_t stride, double per_distance)
{
    return extreme(map, values, stride, per_distance, 1);
}

double boundary_map_greatest(const struct boundary_map *map, const double *values, size_t stride)
{
    return extreme(map, values, stride, 0, -1);
}

double boundary_map_most(const struct boundary_map *map, const double *most)
{
    double least = INFINITY;
    for (uint32_t s = 0; s < map->simplex_count; s++)
        least = smaller(least, most[map->simplex[s]]);
    for (uint32_t f = 0; f < map->face_count; f++)
        for (int k = 0; k < 3; k++)
            least = smaller(least, most[map->faces[f].corners[k]]);
    return least;
}

double boundary_map_moved(const struct boundary_map *map, const double *moved, size_t stride, const double *most,
                          double limit)
{
    double all = larger(boundary_map_least(map, moved, stride, 1), 0), rim = 0;
    for (uint32_t s = 0; s < map->simplex_count; s++)
        if (!map->moves[s])
            all = larger(all, moved[stride * map->simplex[s]]);
    for (uint32_t f = 0; f < map->face_count; f++)
        for (int k = 0; k < 3; k++)
            if (!map->faces[f].inside[k])
                rim = larger(rim, moved[stride * map->faces[f].corners[k]]);
    bool may = all <= limit && (!map->face_count || larger(all, rim) <= boundary_map_most(map, most));
    return may ? all : INFINITY;
}
