/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/shift.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* Faces of both patches are at least this steep: the cosine of their normals with the direction of the map. */
static const double LEAST_SLOPE = 0.2;

/* A direction is good enough if all faces are that steep, and is looked for in so many steps. */
static const double GOOD_SLOPE = 0.9;
enum { MOST_STEPS = 16 };

/* A point whose weight at the result is less than that is on the rim: no value at the result helps there. */
static const double ON_RIM = 1e-12;

/* A face of the old patch; and if just one of its corners is contracted, the new face that it becomes. Corner 0 is contracted, and
 * `vanishes` says whether another one is. Positions in the plane of the map are relative to the result's. */
struct face {
    uint32_t corners[3];
    bool inside[3]; /* is the corner contracted? */
    bool vanishes;
    double flat[3][2];
};

struct work {
    const struct complex *complex;
    const struct star *star;
    const double *p;
    uint32_t count;
    struct shift *shift;
    struct face *faces; /* the shift's */
    double direction[3], axes[2][3];
};

static double cross2(const double a[2], const double b[2])
{
    return a[0] * b[1] - a[1] * b[0];
}

static const double *position(const struct work *work, uint32_t vertex)
{
    return work->complex->positions + 3 * (size_t)vertex;
}

static bool same(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* The face's normal now, or after the contraction. */
static void face_normal(const struct work *work, const struct face *face, bool after, double out[3])
{
    triangle_cross(after ? work->p : position(work, face->corners[0]), position(work, face->corners[1]),
                   position(work, face->corners[2]), out);
}

/* Takes in a boundary face if one of its contracted corners moves. False: no memory. */
static bool add_face(struct work *work, const uint32_t corners[4], unsigned opposite)
{
    struct face face = {0};
    int inside = 0, first = 0;
    bool moves = false;
    for (int k = 0; k < 3; k++) {
        face.corners[k] = corners[tet_faces[opposite][k]];
        for (uint32_t s = 0; s < work->star->simplex_count; s++)
            face.inside[k] |= face.corners[k] == work->star->simplex[s];
        first = face.inside[k] ? k : first;
        inside += face.inside[k];
        moves |= face.inside[k] && !same(position(work, face.corners[k]), work->p);
    }
    if (!moves)
        return true;
    work->shift->failed |= !array_reserve(&work->shift->faces, &work->shift->face_room, work->count + 1, sizeof *work->faces);
    if (work->shift->failed)
        return false;
    work->faces = work->shift->faces;
    struct face *out = &work->faces[work->count++];
    *out = (struct face){.vanishes = inside > 1};
    for (int k = 0; k < 3; k++) {
        out->corners[k] = face.corners[(first + k) % 3];
        out->inside[k] = face.inside[(first + k) % 3];
    }
    return true;
}

static bool gather_faces(struct work *work)
{
    const struct star *star = work->star;
    for (uint32_t i = 0; i < star->tet_count; i++)
        for (unsigned f = 0; f < 4; f++)
            if (complex_boundary_face(work->complex, star->tets[i], f) && star->moving[i] != f &&
                !add_face(work, work->complex->corners + 4 * (size_t)star->tets[i], f))
                return false;
    return true;
}

/* The direction of the map: about the axis of the narrowest cone around the faces' normals, whose steps get shorter. False: a
 * face has no area. */
static bool choose_direction(struct work *work)
{
    double *d = work->direction;
    for (int step = 0; step < MOST_STEPS; step++) {
        double n[3], worst[3] = {0, 0, 0}, least = INFINITY;
        for (uint32_t f = 0; f < work->count; f++) {
            face_normal(work, &work->faces[f], false, n);
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

static void choose_axes(struct work *work)
{
    const double *d = work->direction;
    int least = 0;
    for (int i = 1; i < 3; i++)
        least = fabs(d[i]) < fabs(d[least]) ? i : least;
    double *u = work->axes[0], *v = work->axes[1], size = sqrt(1 - d[least] * d[least]);
    for (int i = 0; i < 3; i++)
        u[i] = ((i == least) - d[least] * d[i]) / size;
    cross(d, u, v);
}

static void flatten(struct work *work)
{
    for (uint32_t f = 0; f < work->count; f++)
        for (int k = 0; k < 3; k++) {
            const double *q = position(work, work->faces[f].corners[k]);
            double r[3] = {q[0] - work->p[0], q[1] - work->p[1], q[2] - work->p[2]};
            for (int i = 0; i < 2; i++)
                work->faces[f].flat[k][i] = dot(work->axes[i], r);
        }
}

/* Does a face lie well over the plane? */
static bool over_plane(const struct work *work, const double n[3])
{
    double height = dot(n, work->direction);
    return height > 0 && height * height > LEAST_SLOPE * LEAST_SLOPE * dot(n, n);
}

/* Is the direction in the sector from a to b, which turns left by less than half a turn? At a it is, at b it is not. */
static bool in_sector(const double direction[2], const double a[2], const double b[2])
{
    double from = cross2(a, direction);
    return (from > 0 || (from == 0 && a[0] * direction[0] + a[1] * direction[1] > 0)) && cross2(direction, b) > 0;
}

/* Does the new fan go around the result at most once? Then no sector begins inside another. */
static bool goes_around_once(const struct work *work)
{
    for (uint32_t f = 0; f < work->count; f++)
        for (uint32_t g = 0; g < work->count; g++)
            if (f != g && !work->faces[f].vanishes && !work->faces[g].vanishes &&
                in_sector(work->faces[f].flat[1], work->faces[g].flat[1], work->faces[g].flat[2]))
                return false;
    return true;
}

/* Are both patches graphs over the plane, and is the new one a fan that goes around at most once? */
static bool graphs(const struct work *work, double cosine)
{
    for (uint32_t f = 0; f < work->count; f++) {
        const struct face *face = &work->faces[f];
        double before[3], after[3];
        face_normal(work, face, false, before);
        if (!over_plane(work, before))
            return false;
        if (face->vanishes)
            continue;
        face_normal(work, face, true, after);
        if (!over_plane(work, after) || !(cross2(face->flat[1], face->flat[2]) > 0) ||
            dot(before, after) < cosine * sqrt(dot(before, before) * dot(after, after)))
            return false;
    }
    return goes_around_once(work);
}

/* Files a vertex of the overlay with its distance. False: no memory. */
static bool add_point(struct shift *shift, const struct work *work, struct shift_point point)
{
    double sum = 0;
    void *points = shift->points;
    shift->failed |= !array_reserve(&points, &shift->point_room, shift->count + 1, sizeof *shift->points);
    shift->points = points;
    if (shift->failed)
        return false;
    for (int i = 0; i < 3; i++) {
        double d = 0, size = 0, *from = point.from_weights, *to = point.to_weights; // relative to the result
        for (int k = 0; k < 5; k++) {
            double x = position(work, k < 3 ? point.from[k] : point.to[k - 3])[i] - work->p[i];
            double part = k < 3 ? from[k] * x : -to[k - 3] * x;
            d += part;
            size += fabs(part);
        }
        d = fabs(d) + 8 * DBL_EPSILON * size; // it is what is left of larger terms
        sum += d * d;
    }
    point.distance = sqrt(sum);
    shift->points[shift->count++] = point;
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
static double weigh(double flat[3][2], const double at[2], double weights[3])
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
static bool map_vertex(struct shift *shift, struct work *work, uint32_t vertex, const double flat[2])
{
    struct shift_point point = {.from = {vertex, vertex, vertex}, .from_weights = {1, 0, 0}};
    double best = -INFINITY, weights[3];
    for (uint32_t f = 0; f < work->count; f++) {
        const struct face *face = &work->faces[f];
        double moved[3][2] = {{0, 0}, {face->flat[1][0], face->flat[1][1]}, {face->flat[2][0], face->flat[2][1]}}, least;
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
    return best > -1e-12 && add_point(shift, work, point);
}

/* The result in the old patch. */
static bool map_result(struct shift *shift, struct work *work)
{
    const double origin[2] = {0, 0};
    double best = -INFINITY, weights[3];
    struct shift_point point = {.apex = 1};
    for (uint32_t f = 0; f < work->count; f++) {
        double least = weigh(work->faces[f].flat, origin, weights);
        if (!(least > best))
            continue;
        best = least;
        make_convex(weights);
        for (int k = 0; k < 3; k++) {
            point.from[k] = work->faces[f].corners[k];
            point.from_weights[k] = weights[k];
        }
        point.to[0] = point.to[1] = point.from[0];
    }
    return best > -1e-12 && add_point(shift, work, point);
}

/* Where an old edge from a to b crosses the new one from the result to x. */
static bool map_crossing(struct shift *shift, const struct work *work, const struct face *old, int k,
                         const struct face *new)
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
    return add_point(shift, work, (struct shift_point){.from = {from, end, end},
                                                       .from_weights = {1 - t, t, 0},
                                                       .to = {new->corners[1], new->corners[1]},
                                                       .apex = 1 - s,
                                                       .to_weights = {s, 0}});
}

/* All crossings. An edge inside the old patch is in two faces: it is taken where it runs up, one at the rim is taken or not. */
static bool map_crossings(struct shift *shift, const struct work *work)
{
    for (uint32_t f = 0; f < work->count; f++)
        for (int k = 0; k < 3; k++) {
            const struct face *old = &work->faces[f];
            uint32_t from = old->corners[k], end = old->corners[(k + 1) % 3];
            if (from > end || !(old->inside[k] || old->inside[(k + 1) % 3]))
                continue;
            for (uint32_t g = 0; g < work->count; g++)
                if (!work->faces[g].vanishes && !map_crossing(shift, work, old, k, &work->faces[g]))
                    return false;
        }
    return true;
}

/* Vertices that are contracted and move, each from the first face that has it; and the result, if it is none of them. */
static bool map_vertices(struct shift *shift, struct work *work)
{
    bool result = true;
    for (uint32_t s = 0; s < work->star->simplex_count; s++) {
        uint32_t vertex = work->star->simplex[s];
        bool found = false, moves = !same(position(work, vertex), work->p);
        result &= moves;
        for (uint32_t f = 0; f < work->count && moves && !found; f++)
            for (int k = 0; k < 3 && !found; k++) {
                found = work->faces[f].corners[k] == vertex;
                if (found && !map_vertex(shift, work, vertex, work->faces[f].flat[k]))
                    return false;
            }
    }
    return !result || map_result(shift, work);
}

void shift_fini(struct shift *shift)
{
    free(shift->points);
    free(shift->faces);
    *shift = (struct shift){0};
}

bool shift_map(struct shift *shift, const struct complex *complex, const struct star *star, const double p[3],
               double cosine)
{
    struct work work = {.complex = complex, .star = star, .p = p, .shift = shift};
    shift->count = 0;
    if (!gather_faces(&work))
        return false;
    if (!work.count)
        return true;
    if (!choose_direction(&work))
        return false;
    choose_axes(&work);
    flatten(&work);
    return graphs(&work, cosine) && map_vertices(shift, &work) && map_crossings(shift, &work);
}

/* What the result's value must be, from above (sign 1) or below (-1), widened by the rounding of doing so. */
static double extreme(const struct shift *shift, const double *values, double per_distance, double sign)
{
    double extreme = -INFINITY;
    for (uint32_t i = 0; i < shift->count; i++) {
        const struct shift_point *at = &shift->points[i];
        double base = values[at->from[0]], needed = per_distance * at->distance, size = needed;
        for (int k = 0; k < 5; k++) {
            double weight = k < 3 ? at->from_weights[k] : -at->to_weights[k - 3];
            double part = weight * (values[k < 3 ? at->from[k] : at->to[k - 3]] - base) * sign;
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

double shift_least(const struct shift *shift, const double *values, double per_distance)
{
    return extreme(shift, values, per_distance, 1);
}

double shift_greatest(const struct shift *shift, const double *values)
{
    return extreme(shift, values, 0, -1);
}
