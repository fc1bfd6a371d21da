/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/boundary_check.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/exact_cell.h"
#include "src/measure/measure.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/mesh_surface.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Parts of a face that are looked at, at most; where there are many faces; and where the boundary is where it was. */
enum { MAX_PARTS = 85, MAX_PARTS_OF_MANY = 21, MAX_PARTS_KEPT = 5, MANY_FACES = 5000 };

/* Faces that are asked before all are searched; vertices of them that are kept for the next level. */
enum { MAX_NEAR = 24, WITNESSES = 6 };

/* How far a boundary may be off by rounding, as a fraction of the diagonal (build.c: BOUNDARY_KEPT). */
static const double KEPT = 1e-12;

/* A face of less than that, as the square of a sine, is almost a line. */
static const double FLAT = 1e-8;

struct boundary_check {
    const struct tetmesh *original; /* borrowed */
    const uint32_t *bodies;
    unsigned threads;
    struct mesh_surface surface; /* of the original */
    /* [WITNESSES * face of it] vertices of the level's faces that are near to what was looked at of it; TETLOD_NONE */
    uint32_t *witnesses;
    double rounding, limit;      /* limit: of the level before */
};

/* One way. */
struct way {
    const struct boundary_check *check;
    const struct mesh_surface *from, *to;
    const uint32_t *to_corners; /* of its tetrahedra */
    const uint8_t *touched; /* NULL: all */
    bool forth;             /* from the original */
    double limit;
    double *found; /* [face of from] a distance above the limit, or 0 */
};

/* A face of `to`, ready to be asked for distances. */
struct near_face {
    uint32_t face; /* 4 * tet + face */
    const double *corners[3];
    double u[3], v[3], normal[3], uu, uv, vv, area2; /* of its sides from corner 0; area2: its square, times 4 */
};

/* A triangle that is being looked at, and the parts that it was cut into, the largest first. */
struct look {
    const struct way *way;
    uint32_t body;
    struct near_face near[MAX_NEAR + 1]; /* each point so far is near one of them, */
    int near_count;                      /* which there is always room after, */
    bool more;                           /* or near others */
    int part_count, max_parts;
    double distance, found; /* of the last point; the largest above the limit */
    double parts[MAX_PARTS][3][3];
};

/* Beside faces that are almost lines doubles say anything: before a distance is too much it is taken in 113 bits, of
 * all faces. */
static double exact_distance(const struct look *look, const double p[3])
{
    const struct mesh_surface *to = look->way->to;
    double best = INFINITY;
    for (size_t f = 0; f < to->count; f++) {
        const uint32_t *v = to->triangles + 3 * f;
        if (!to->bodies || to->bodies[v[0]] == look->body)
            best =
                smaller(best, exact_triangle_distance2(p, (const double *const[3]){to->positions + 3 * (size_t)v[0],
                                                                                   to->positions + 3 * (size_t)v[1],
                                                                                   to->positions + 3 * (size_t)v[2]}));
    }
    return sqrt(best);
}

static uint32_t face_vertex(const struct way *way, uint32_t face, int k)
{
    return way->to_corners[(face & ~(size_t)3) + tet_faces[face & 3][k]];
}

static struct near_face near_face(const struct way *way, uint32_t face)
{
    struct near_face near = {.face = face};
    for (int k = 0; k < 3; k++)
        near.corners[k] = way->to->positions + 3 * (size_t)face_vertex(way, face, k);
    subtract(near.corners[1], near.corners[0], near.u);
    subtract(near.corners[2], near.corners[0], near.v);
    cross(near.u, near.v, near.normal);
    near.uu = dot(near.u, near.u);
    near.uv = dot(near.u, near.v);
    near.vv = dot(near.v, near.v);
    near.area2 = dot(near.normal, near.normal);
    return near;
}

/* The square of the distance. The nearest point of a triangle is below the point, or on a side that the point is
 * beyond. What is almost a line is left to triangle_distance2. */
static double distance2_of(const struct near_face *near, const double p[3])
{
    double w[3], weights[3], best = INFINITY, t;
    const double *const *q = near->corners;
    if (!(near->area2 > FLAT * near->uu * near->vv))
        return triangle_distance2(p, q[0], q[1], q[2], weights);
    subtract(p, q[0], w);
    double wu = dot(w, near->u), wv = dot(w, near->v), height = dot(near->normal, w);
    double s = near->vv * wu - near->uv * wv, r = near->uu * wv - near->uv * wu;
    if (r < 0)
        best = segment_distance2(p, q[0], q[1], &t);
    if (s < 0)
        best = smaller(best, segment_distance2(p, q[0], q[2], &t));
    if (s + r > near->area2)
        best = smaller(best, segment_distance2(p, q[1], q[2], &t));
    return best < INFINITY ? best : height * height / near->area2;
}

/* The distance from the faces that were near to points before: the least one, or the first within the limit if that
 * will do. */
static double distance_of_near(const struct look *look, const double p[3], bool least, int *out_near)
{
    double best = INFINITY, enough = least ? 0 : look->way->limit * look->way->limit;
    for (int i = 0; i < look->near_count && !(best <= enough); i++) {
        double distance2 = distance2_of(&look->near[i], p);
        *out_near = distance2 < best ? i : *out_near;
        best = smaller(best, distance2);
    }
    return sqrt(best);
}

/* Sets look->distance, to that of a face within the limit if there is one; `least`: of the nearest one of several.
 * out_near: which of look->near that is, if there is any. */
static void test_point(struct look *look, const double p[3], bool least, int *out_near)
{
    uint32_t face;
    look->distance = distance_of_near(look, p, least, out_near);
    if (look->distance <= look->way->limit)
        return;
    look->distance = mesh_surface_distance(look->way->to, look->body, p, look->way->check->rounding, &face);
    bool sure = look->distance <= look->way->limit && look->near_count < MAX_NEAR;
    *out_near = look->near_count;
    if (face != TETLOD_NONE)
        look->near[look->near_count] = near_face(look->way, face);
    look->near_count += sure;
    look->more |= !sure;
    if (look->distance > look->way->limit)
        look->distance = exact_distance(look, p);
    if (look->distance > look->way->limit)
        look->found = larger(look->found, look->distance);
}

/* Is the face near enough to all of the triangle? The distance from a triangle is largest at a corner. */
static bool is_near(const struct look *look, double p[3][3], const struct near_face *face)
{
    bool near = true;
    for (int k = 0; k < 3 && near; k++)
        near = sqrt(distance2_of(face, p[k])) <= look->way->limit;
    return near;
}

static void middle(const double *p, const double *q, double out[3])
{
    for (int d = 0; d < 3; d++)
        out[d] = 0.5 * (p[d] + q[d]);
}

static void add_part(struct look *look, const double *p, const double *q, const double *r)
{
    double(*part)[3] = look->parts[look->part_count++];
    memcpy(part[0], p, sizeof *part);
    memcpy(part[1], q, sizeof *part);
    memcpy(part[2], r, sizeof *part);
}

/* Looks at a part; sets look->found if a point of it is too far. If it is not known to be near as a whole, it is cut
 * into four. */
static void look_at(struct look *look, int number)
{
    double centre[3], middles[3][3], (*p)[3] = look->parts[number], reach = 0;
    int near, other;
    for (int d = 0; d < 3; d++)
        centre[d] = (p[0][d] + p[1][d] + p[2][d]) / 3;
    test_point(look, centre, true, &near);
    for (int k = 0; k < 3; k++)
        reach = larger(reach, distance_squared(centre, p[k]));
    if (look->found > 0 || look->distance + sqrt(reach) <= look->way->limit)
        return;
    if (is_near(look, p, &look->near[near])) {
        if (number == 0) { // it alone will do
            look->near[0] = look->near[near];
            look->near_count = 1;
            look->more = false;
        }
        return;
    }
    for (int k = 0; k < 3 && !(look->found > 0); k++) {
        middle(p[k], p[(k + 1) % 3], middles[k]);
        test_point(look, middles[k], false, &other);
    }
    if (look->found > 0 || look->part_count + 4 > look->max_parts)
        return;
    for (int k = 0; k < 3; k++)
        add_part(look, p[k], middles[k], middles[(k + 2) % 3]);
    add_part(look, middles[0], middles[1], middles[2]);
}

/* Was the face looked at before, and is all that it was held against what it was? */
static bool is_known(const struct way *way, size_t face)
{
    const uint32_t *of = way->forth ? way->check->witnesses + WITNESSES * face : way->from->triangles + 3 * face;
    bool known = way->touched && of[0] != TETLOD_NONE;
    for (int k = 0; known && k < (way->forth ? WITNESSES : 3); k++)
        known = of[k] == TETLOD_NONE || !way->touched[of[k]];
    return known;
}

/* The vertices of the faces that all points were near to; none if there are too many. */
static void keep_witnesses(const struct look *look, uint32_t out[WITNESSES])
{
    int count = 0;
    memset(out, 0xff, WITNESSES * sizeof *out);
    for (int i = 0; i < 3 * look->near_count && !look->more && count <= WITNESSES; i++) {
        uint32_t v = face_vertex(look->way, look->near[i / 3].face, i % 3);
        bool is_new = true;
        for (int k = 0; k < count; k++)
            is_new &= out[k] != v;
        if (is_new && count < WITNESSES)
            out[count] = v;
        count += is_new;
    }
    if (count > WITNESSES)
        out[0] = TETLOD_NONE;
}

static int max_parts(const struct way *way)
{
    if (way->limit <= 2 * way->check->rounding)
        return MAX_PARTS_KEPT;
    return way->check->surface.count > MANY_FACES ? MAX_PARTS_OF_MANY : MAX_PARTS;
}

static void look_at_face(struct look *look, size_t f)
{
    const struct way *way = look->way;
    const uint32_t *v = way->from->triangles + 3 * f;
    const double *p[3];
    int near;
    look->body = way->check->bodies ? way->check->bodies[v[0]] : 0;
    look->near_count = look->part_count = 0;
    look->more = false;
    look->found = 0;
    for (int k = 0; k < 3; k++) {
        p[k] = way->from->positions + 3 * (size_t)v[k];
        test_point(look, p[k], false, &near);
    }
    add_part(look, p[0], p[1], p[2]);
    for (int i = 0; i < look->part_count && !(look->found > 0); i++)
        look_at(look, i);
}

static void look_at_faces(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct way *way = context;
    struct look look;
    (void)worker;
    look.way = way;
    look.max_parts = max_parts(way);
    for (size_t f = begin; f < end; f++) {
        way->found[f] = 0;
        if (is_known(way, f))
            continue;
        look_at_face(&look, f);
        way->found[f] = look.found;
        if (way->forth)
            keep_witnesses(&look, way->check->witnesses + WITNESSES * f);
    }
}

static enum tetlod_status go(struct way *way, double *out_distance, struct tetlod_error *error)
{
    way->found = array_new(way->from->count, sizeof *way->found);
    if (!way->found)
        return tetlodi_fail_nomem(error, "the boundary", way->from->count * (uint64_t)8);
    parallel_for(way->check->threads, way->from->count, 64, look_at_faces, way);
    for (uint32_t f = 0; f < way->from->count; f++)
        *out_distance = larger(*out_distance, way->found[f]);
    free(way->found);
    return TETLOD_OK;
}

static enum tetlod_status make_surface(struct mesh_surface *surface, const struct tetmesh *mesh,
                                       const uint32_t *neighbours, const uint32_t *bodies, struct tetlod_error *error)
{
    TETLOD_TRY(mesh_surface_init(surface, mesh->positions, mesh->corners, neighbours, mesh->tet_count, NULL, 0, 0,
                                 error));
    surface->bodies = bodies;
    return TETLOD_OK;
}

static enum tetlod_status make_original_surface(struct boundary_check *check, struct tetlod_error *error)
{
    const struct tetmesh *mesh = check->original;
    uint32_t *neighbours = array_new(mesh->tet_count, 4 * sizeof *neighbours);
    enum tetlod_status status = TETLOD_OK;
    if (!neighbours)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the boundary", 16 * (uint64_t)mesh->tet_count));
    TETLOD_TRY_DONE(adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL, error));
    status = make_surface(&check->surface, mesh, neighbours, check->bodies, error);
done:
    free(neighbours);
    return status;
}

enum tetlod_status boundary_check_level(struct boundary_check *check, const struct tetmesh *level,
                                        const uint32_t *neighbours, const uint8_t *touched,
                                        double limit, double *out_distance, struct tetlod_error *error)
{
    struct mesh_surface surface = {0};
    *out_distance = 0;
    if (limit < check->limit) // what was near enough then may not be now
        touched = NULL;
    check->limit = limit;
    TETLOD_TRY(make_surface(&surface, level, neighbours, check->bodies, error));
    struct way forth = {.check = check, .from = &check->surface, .to = &surface, .to_corners = level->corners,
                        .touched = touched, .forth = true};
    forth.limit = limit * (1 + 1e-9) + check->rounding;
    struct way back = forth;
    back.from = &surface;
    back.to = &check->surface;
    back.to_corners = check->original->corners;
    back.forth = false;
    enum tetlod_status status = go(&forth, out_distance, error);
    if (status == TETLOD_OK)
        status = go(&back, out_distance, error);
    mesh_surface_fini(&surface);
    return status;
}

enum tetlod_status boundary_check_new(struct boundary_check **out, const struct tetmesh *original,
                                      const uint32_t *bodies,
                                      unsigned threads, struct tetlod_error *error)
{
    struct boundary_check *check = array_zero(1, sizeof *check);
    enum tetlod_status status = TETLOD_OK;
    *out = NULL;
    if (!check)
        return tetlodi_fail_nomem(error, "the boundary", sizeof *check);
    *check = (struct boundary_check){.original = original, .bodies = bodies, .threads = threads};
    check->rounding = KEPT * mesh_diagonal(original);
    for (size_t i = 0; i < 3 * (size_t)original->vertex_count; i++)
        check->rounding = larger(check->rounding, 16 * DBL_EPSILON * fabs(original->positions[i]));
    TETLOD_TRY_DONE(make_original_surface(check, error));
    check->witnesses = array_new(check->surface.count, WITNESSES * sizeof *check->witnesses);
    if (!check->witnesses)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the boundary",
                                           check->surface.count * (uint64_t)(WITNESSES * sizeof *check->witnesses)));
    memset(check->witnesses, 0xff, WITNESSES * (size_t)check->surface.count * sizeof *check->witnesses);
    *out = check;
done:
    if (status != TETLOD_OK)
        boundary_check_free(check);
    return status;
}

void boundary_check_free(struct boundary_check *check)
{
    if (!check)
        return;
    mesh_surface_fini(&check->surface);
    free(check->witnesses);
    free(check);
}
