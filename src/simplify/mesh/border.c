/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/mesh/border.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/simplify/mesh/clearance.h"
#include "src/simplify/mesh/table.h"
#include "src/util/array.h"
#include "src/util/parallel.h"
#include "src/util/union_find.h"

/* ---- which faces and vertices there are */

struct finder {
    struct working *working;
    uint8_t *folded; /* [tet] */
    struct star_data star_data[PARALLEL_MAX_THREADS];
    struct table pairs[PARALLEL_MAX_THREADS];
    uint32_t *parents[PARALLEL_MAX_THREADS]; /* [tet of the star] */
    size_t parent_room[PARALLEL_MAX_THREADS];
    atomic_bool failed;
};

static uint64_t pair_of(const struct star_data *data, uint32_t tet, int k)
{
    return pair_key(data->corners[(k + 1) % 3][tet], data->corners[(k + 2) % 3][tet]);
}

static void set_boundary(struct working *working, uint32_t tet, uint32_t opposite)
{
    const uint32_t *corners = working->corners[tet];
    unsigned f = corner_of(corners, opposite);
    __atomic_fetch_or(&working->boundary_faces[tet], (uint8_t)(1u << f), __ATOMIC_RELAXED);
    for (unsigned c = 0; c < 4; c++)
        if (c != f)
            __atomic_fetch_or(&working->flags[corners[c]], VERTEX_BOUNDARY, __ATOMIC_RELAXED);
}

/* What is known of a face with the slot: how many of its tetrahedra were seen, up to three, whether the first lists it
 * upwards, and which that is. */
enum { FACE_ONE = 1, FACE_MANY = 3, FACE_UPWARDS = 4, FACE_FIRST = 8 };

/* The link of a slot: its pieces, if triangles hang together where just two are at an edge, and how many such edges
 * there are; `many`: more than two are at some edge. */
struct link {
    uint32_t pieces, pairs;
    bool many;
};

/* Looks at the faces of the slot. Two tetrahedra of a face that list it in the same turn lie on one side of it: they
 * are folds. */
static struct link join_faces(struct finder *finder, const struct star_data *data, struct table *pairs,
                              uint32_t *parent)
{
    struct link link = {.pieces = data->tet_count};
    for (uint32_t t = 0; t < data->tet_count; t++) {
        parent[t] = t;
        for (int k = 0; k < 3; k++) {
            uint32_t upwards = data->corners[(k + 1) % 3][t] < data->corners[(k + 2) % 3][t] ? FACE_UPWARDS : 0;
            uint32_t *face = table_at(pairs, pair_of(data, t, k), t * FACE_FIRST + upwards), first = *face / FACE_FIRST;
            uint32_t seen = *face % FACE_UPWARDS;
            link.many |= seen > FACE_ONE;
            *face += seen < FACE_MANY ? FACE_ONE : 0;
            if (seen != FACE_ONE)
                continue;
            if ((*face & FACE_UPWARDS) == upwards) {
                __atomic_store_n(&finder->folded[data->tets[t]], 1, __ATOMIC_RELAXED);
                __atomic_store_n(&finder->folded[data->tets[first]], 1, __ATOMIC_RELAXED);
            }
            link.pairs++;
            link.pieces -= join_sets(parent, first, t);
        }
    }
    return link;
}

/* Faces of the slot that are not exactly two tetrahedra's are on the boundary. The slot is singular unless its link is
 * a sphere, or a disc at the boundary: in one piece, and of the right Euler characteristic. */
static bool find_faces(struct finder *finder, unsigned worker, uint32_t slot)
{
    struct star_data *data = &finder->star_data[worker];
    struct table *pairs = &finder->pairs[worker];
    if (!star_data_gather(data, finder->working, slot) || !table_clear(pairs, 3 * (size_t)data->tet_count) ||
        !ARRAY_RESERVE(finder->parents[worker], finder->parent_room[worker], data->tet_count))
        return false;
    struct link link = join_faces(finder, data, pairs, finder->parents[worker]);
    bool open = link.many || 2 * link.pairs < 3 * data->tet_count;
    for (uint32_t t = 0; t < data->tet_count && open; t++)
        for (int k = 0; k < 3; k++)
            if (*table_at(pairs, pair_of(data, t, k), 0) % FACE_UPWARDS != 2)
                set_boundary(finder->working, data->tets[t], data->slots[data->corners[k][t]]);
    int edges = (int)(3 * data->tet_count - link.pairs), euler = (int)data->count - edges + (int)data->tet_count;
    if (link.many || link.pieces != 1 || euler != (open ? 1 : 2))
        __atomic_fetch_or(&finder->working->flags[slot], VERTEX_SINGULAR, __ATOMIC_RELAXED);
    return true;
}

static void find_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct finder *finder = context;
    for (size_t v = begin; v < end && !atomic_load(&finder->failed); v++)
        if (!find_faces(finder, worker, (uint32_t)v))
            atomic_store(&finder->failed, true);
}

/* A tetrahedron that is folded over a neighbour is frozen with it, unless one of them is inverted, which is another
 * matter. */
static void freeze_folded(const struct finder *finder)
{
    struct working *working = finder->working;
    for (uint32_t t = 0; t < working->tet_count; t++) {
        if (!finder->folded[t] || !border_folded(working, t))
            continue;
        working->log->folded_tets++;
        for (int c = 0; c < 4; c++)
            working->flags[working->corners[t][c]] |= VERTEX_FROZEN;
    }
}

/* Is the tetrahedron across the face opposite a corner on the same side of it, both well oriented? */
static bool folded_at(const struct working *working, uint32_t tet, unsigned opposite)
{
    const uint32_t *own = working->corners[tet];
    uint32_t first = own[tet_faces[opposite][0]], second = own[tet_faces[opposite][1]],
             third = own[tet_faces[opposite][2]];
    const struct span *star = &working->stars[first];
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t other = working->pool[star->begin + i];
        const uint32_t *corners = working->corners[other];
        for (unsigned f = 0; f < 4 && other != tet && corners[0] != TETLOD_NONE; f++)
            for (int k = 0; k < 3; k++)
                if (corners[tet_faces[f][k]] == first && corners[tet_faces[f][(k + 1) % 3]] == second &&
                    corners[tet_faces[f][(k + 2) % 3]] == third && working_orientation(working, other) > 0)
                    return true;
    }
    return false;
}

bool border_folded(const struct working *working, uint32_t tet)
{
    if (working_orientation(working, tet) <= 0)
        return false;
    for (unsigned f = 0; f < 4; f++)
        if (!(working->boundary_faces[tet] >> f & 1) && folded_at(working, tet, f))
            return true;
    return false;
}

enum tetlod_status border_find(struct working *working, struct pool *pool, struct tetlod_error *error)
{
    struct finder *finder = array_zero(1, sizeof *finder);
    if (!finder)
        return tetlodi_fail_nomem(error, "the boundary", sizeof *finder);
    finder->working = working;
    finder->folded = array_zero(working->tet_count, 1);
    atomic_store(&finder->failed, !finder->folded);
    pool_run(pool, working->slot_count, 1024, find_range, finder);
    bool failed = atomic_load(&finder->failed);
    if (!failed)
        freeze_folded(finder);
    free(finder->folded);
    for (unsigned w = 0; w < PARALLEL_MAX_THREADS; w++) {
        star_data_fini(&finder->star_data[w]);
        table_fini(&finder->pairs[w]);
        free(finder->parents[w]);
    }
    free(finder);
    return failed ? tetlodi_fail_nomem(error, "the boundary", working->slot_count) : TETLOD_OK;
}

/* ---- where they may move */

/* What the boundary faces around a vertex say of its kind: their normals, in two groups. */
struct normals {
    double groups[2][3];
    int count;
    bool corner; /* there are more, or a face without area */
};

/* Taylor's series of an angle so small that ten terms are exact, then six times doubled. */
static void find_angle(double degrees, double *cosine, double *sine)
{
    enum { DOUBLINGS = 6, TERMS = 10 };
    double x = degrees * (3.14159265358979323846 / 180) / (1 << DOUBLINGS), c = 1, s = x, c_term = 1, s_term = x;
    for (int k = 1; k < TERMS; k++) {
        c_term *= -x * x / ((2 * k - 1) * (2 * k));
        s_term *= -x * x / ((2 * k) * (2 * k + 1));
        c += c_term;
        s += s_term;
    }
    for (int i = 0; i < DOUBLINGS; i++) {
        double twice = 2 * s * c;
        c = 1 - 2 * s * s;
        s = twice;
    }
    *cosine = c;
    *sine = s;
}

/* The unit normal of the triangle; false if it has no area. */
static bool triangle_normal(const double *p, const double *q, const double *r, double out[3])
{
    double a[3], b[3];
    subtract(q, p, a);
    subtract(r, p, b);
    cross(a, b, out);
    double length = sqrt(dot(out, out));
    if (!(length * length > 1e-24 * dot(a, a) * dot(b, b)))
        return false;
    for (int i = 0; i < 3; i++)
        out[i] /= length;
    return true;
}

static void normals_add(struct normals *normals, double cosine, const double *p, const double *q, const double *r)
{
    double normal[3];
    if (normals->corner || (normals->corner = !triangle_normal(p, q, r, normal)))
        return;
    for (int g = 0; g < normals->count; g++)
        if (dot(normals->groups[g], normal) >= cosine)
            return;
    normals->corner = normals->count == 2;
    if (!normals->corner)
        memcpy(normals->groups[normals->count++], normal, sizeof normal);
}

static enum boundary_kind normals_kind(const struct normals *normals, float direction[3])
{
    double d[3];
    if (normals->count == 1)
        memcpy(d, normals->groups[0], sizeof d);
    else
        cross(normals->groups[0], normals->groups[1], d);
    double length = sqrt(dot(d, d));
    if (normals->corner || !(length > 0))
        return BOUNDARY_CORNER;
    for (int i = 0; i < 3; i++)
        direction[i] = (float)(d[i] / length);
    return normals->count == 1 ? BOUNDARY_SMOOTH : BOUNDARY_CREASE;
}

static bool step_allowed(enum boundary_kind kind, const float direction[3], double sine, double limit,
                         const double step[3])
{
    double length2 = dot(step, step), along = direction[0] * step[0] + direction[1] * step[1] + direction[2] * step[2];
    double slope2 = sine * sine * length2 + limit * limit * 1e-6;
    switch (kind) {
    case BOUNDARY_SMOOTH:
        return along * along <= slope2;
    case BOUNDARY_CREASE:
        return length2 - along * along <= slope2;
    case BOUNDARY_CORNER:
        break;
    }
    return length2 == 0;
}

void border_classify(struct border *border, const struct working *working, uint32_t slot)
{
    const struct span *star = &working->stars[slot];
    struct normals normals = {0};
    for (uint32_t i = 0; i < star->count && !normals.corner; i++) {
        uint32_t tet = working->pool[star->begin + i];
        const uint32_t *corners = working->corners[tet];
        unsigned faces = tet_gone(working, tet) ? 0 : working->boundary_faces[tet];
        for (unsigned f = 0; faces >> f; f++)
            if (faces >> f & 1 && corners[f] != slot)
                normals_add(&normals, border->cosine, working_row(working, corners[tet_faces[f][0]]),
                            working_row(working, corners[tet_faces[f][1]]),
                            working_row(working, corners[tet_faces[f][2]]));
    }
    border->kinds[slot] = normals_kind(&normals, border->directions + 3 * (size_t)slot);
}

static uint32_t vertex_of(const struct working *working, uint32_t slot)
{
    return working->node ? working->node[slot] : slot;
}

/* The corners of the boundary faces in the mesh's numbers; their count in *out_count, NULL: no memory. */
static uint32_t *list_faces(const struct working *working, uint32_t *out_count)
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < working->tet_count; t++)
        for (unsigned faces = working->boundary_faces[t]; faces; faces &= faces - 1)
            count++;
    uint32_t *triangles = array_new(count, 3 * sizeof(uint32_t)), *next = triangles;
    for (uint32_t t = 0; t < working->tet_count && triangles; t++)
        for (unsigned f = 0; working->boundary_faces[t] >> f; f++)
            for (int k = 0; k < 3 && working->boundary_faces[t] >> f & 1; k++)
                *next++ = vertex_of(working, working->corners[t][tet_faces[f][k]]);
    *out_count = count;
    return triangles;
}

enum tetlod_status border_find_most(double *out, const struct working *working, const struct tetmesh *mesh,
                                    double limit, double least, unsigned threads, struct tetlod_error *error)
{
    struct clearance_mesh of = {.positions = mesh->positions, .corners = mesh->corners,
                                .vertex_count = mesh->vertex_count,
                                .tet_count = mesh->tet_count};
    uint32_t *triangles = list_faces(working, &of.triangle_count);
    of.triangles = triangles;
    enum tetlod_status status = triangles ? clearance_find(&of, limit, least, threads, out, error)
                                          : tetlodi_fail_nomem(error, "the boundary", 12 * (uint64_t)mesh->tet_count);
    free(triangles);
    return status;
}

/* All but how far the vertices may move. */
static enum tetlod_status open_border(struct border *border, const struct working *working, double angle_degrees,
                                      double limit, struct tetlod_error *error)
{
    size_t n = working->slot_count;
    *border = (struct border){.limit = limit, .kinds = array_zero(n, 1), .directions = array_zero(n, 3 * sizeof(float)),
                              .most = array_new(n, sizeof(double))};
    find_angle(angle_degrees, &border->cosine, &border->sine);
    if (!border->kinds || !border->directions || !border->most)
        return tetlodi_fail_nomem(error, "the boundary", n * 21);
    for (uint32_t v = 0; v < n; v++)
        if (working->flags[v] & VERTEX_BOUNDARY)
            border_classify(border, working, v);
    return TETLOD_OK;
}

enum tetlod_status border_resume(struct border *border, const struct working *working, const double *most,
                                 double angle_degrees, double limit, struct tetlod_error *error)
{
    TETLOD_TRY(open_border(border, working, angle_degrees, limit, error));
    for (uint32_t v = 0; v < working->slot_count; v++)
        border->most[v] = most[working->node[v]];
    return TETLOD_OK;
}

enum tetlod_status border_init(struct border *border, const struct working *working, const struct tetmesh *mesh,
                               double angle_degrees, double limit, double least, unsigned threads,
                               struct tetlod_error *error)
{
    double *most = array_new(mesh->vertex_count, sizeof *most);
    enum tetlod_status status = most ? open_border(border, working, angle_degrees, limit, error)
                                     : tetlodi_fail_nomem(error, "the boundary", 8 * (uint64_t)mesh->vertex_count);
    if (status == TETLOD_OK)
        status = border_find_most(most, working, mesh, limit, least, threads, error);
    for (uint32_t v = 0; v < mesh->vertex_count && status == TETLOD_OK; v++)
        border->most[v] = most[working->node[v]];
    free(most);
    return status;
}

void border_renumber(struct border *border, const struct renumbering *numbers)
{
    border->most = renumber_slots(numbers, border->most, sizeof *border->most);
    border->kinds = renumber_slots(numbers, border->kinds, 1);
    border->directions = renumber_slots(numbers, border->directions, 3 * sizeof *border->directions);
}

void border_fini(struct border *border)
{
    free(border->kinds);
    free(border->directions);
    free(border->most);
    *border = (struct border){0};
}

bool border_may_move(const struct border *border, uint32_t slot, const double step[3])
{
    return step_allowed(border->kinds[slot], border->directions + 3 * (size_t)slot, border->sine, border->limit, step);
}

bool border_allows(const struct border *border, const struct working *working, const uint32_t *simplex, uint32_t count,
                   const double weights[4], const double p[3])
{
    bool touches = false;
    uint32_t fixed = 0;
    for (uint32_t s = 0; s < count; s++) {
        uint8_t flags = working->flags[simplex[s]];
        touches |= flags & VERTEX_BOUNDARY;
        fixed += (flags & VERTEX_FIXED) != 0;
        if (flags & VERTEX_FIXED && (fixed > 1 || distance_squared(working_row(working, simplex[s]), p) != 0))
            return false;
    }
    for (uint32_t s = 0; s < count && touches; s++) {
        double step[3];
        subtract(p, working_row(working, simplex[s]), step);
        if (working->flags[simplex[s]] & VERTEX_BOUNDARY ? !border_may_move(border, simplex[s], step) : weights[s] != 0)
            return false;
    }
    return true;
}

void border_follow(const struct border *border, const struct working *working, const uint32_t *simplex, uint32_t count,
                   double vector[3])
{
    for (uint32_t s = 0; s < count; s++) {
        uint32_t v = simplex[s];
        const float *d = border->directions + 3 * (size_t)v;
        if (!(working->flags[v] & VERTEX_BOUNDARY))
            continue;
        double along = d[0] * vector[0] + d[1] * vector[1] + d[2] * vector[2];
        for (int i = 0; i < 3; i++)
            vector[i] = border->kinds[v] == BOUNDARY_SMOOTH   ? vector[i] - along * d[i]
                        : border->kinds[v] == BOUNDARY_CREASE ? along * d[i]
                                                              : 0;
    }
}

/* ---- the map of contracting a simplex */

/* The boundary faces that have a vertex that moves, each once. */
static void add_faces(struct boundary_map *map, const struct working *working, uint32_t of)
{
    const struct span *star = &working->stars[map->simplex[of]];
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i];
        const uint32_t *corners = working->corners[tet];
        unsigned faces = tet_gone(working, tet) ? 0 : working->boundary_faces[tet];
        for (unsigned f = 0; faces >> f; f++) {
            bool again = false; // it came with an earlier one
            for (uint32_t s = 0; s < of; s++)
                for (unsigned c = 0; c < 4; c++)
                    again |= map->moves[s] && c != f && corners[c] == map->simplex[s];
            if (faces >> f & 1 && corners[f] != map->simplex[of] && !again)
                boundary_map_add_face(map, corners, f);
        }
    }
}

/* All faces are in planes across an axis, the result in each of them, and nothing has moved yet: the boundary's points
 * stay. */
static bool stays(const struct boundary_map *map, const struct working *working)
{
    uint32_t moved = row_moved(working);
    for (uint32_t f = 0; f < map->face_count; f++) {
        const double *p[3];
        bool in_plane = false;
        for (int k = 0; k < 3; k++) {
            p[k] = working_row(working, map->faces[f].corners[k]);
            if (p[k][moved] != 0)
                return false;
        }
        for (int i = 0; i < 3; i++)
            in_plane |= p[0][i] == map->p[i] && p[1][i] == map->p[i] && p[2][i] == map->p[i];
        if (!in_plane)
            return false;
    }
    return true;
}

double border_moves(const struct border *border, const struct working *working, const uint32_t *simplex, uint32_t count,
                    const double p[3], struct boundary_map *map)
{
    boundary_map_begin(map, working->rows, working->stride, simplex, count, p);
    for (uint32_t s = 0; s < count; s++) {
        map->moves[s] &= (working->flags[simplex[s]] & VERTEX_BOUNDARY) != 0;
        if (map->moves[s])
            add_faces(map, working, s);
    }
    if (map->failed || (!stays(map, working) && !boundary_map_find(map, border->cosine)))
        return INFINITY;
    return boundary_map_moved(map, working->rows + row_moved(working), working->stride, border->most, border->limit);
}
