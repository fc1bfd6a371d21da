/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/boundary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/triangle.h"
#include "src/mesh/vector.h"
#include "src/simplify/clearance.h"
#include "src/util/array.h"

/* Taylor's series of an angle so small that ten terms are exact, then six times doubled. */
void boundary_angle(double degrees, double *cosine, double *sine)
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

void boundary_normals_add(struct boundary_normals *normals, double cosine, const double *p, const double *q, const double *r)
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

enum boundary_kind boundary_normals_kind(const struct boundary_normals *normals, float direction[3])
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

bool boundary_step_allowed(enum boundary_kind kind, const float direction[3], double sine, double limit, const double step[3])
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

static void classify(struct boundary *boundary, const struct complex *complex, uint32_t v)
{
    const uint32_t *tets = complex->pool + complex->star_begin[v];
    struct boundary_normals normals = {0};
    for (uint32_t i = 0; i < complex->star_count[v] && !normals.corner; i++)
        for (unsigned f = 0; f < 4; f++) {
            const uint32_t *corners = complex->corners + 4 * (size_t)tets[i];
            if (complex_boundary_face(complex, tets[i], f) && corners[f] != v)
                boundary_normals_add(&normals, boundary->cosine, complex->positions + 3 * (size_t)corners[tet_faces[f][0]],
                                     complex->positions + 3 * (size_t)corners[tet_faces[f][1]],
                                     complex->positions + 3 * (size_t)corners[tet_faces[f][2]]);
        }
    boundary->kinds[v] = boundary_normals_kind(&normals, boundary->directions + 3 * (size_t)v);
}

static enum tetlod_status find_most(struct boundary *boundary, const struct complex *complex, double least, struct tetlod_error *error)
{
    struct clearance_mesh mesh = {.positions = complex->positions, .corners = complex->corners,
                                  .vertex_count = complex->vertex_count, .tet_count = complex->tet_count};
    for (size_t s = 0; s < 4 * (size_t)complex->tet_count; s++)
        mesh.triangle_count += complex->neighbours[s] == TETLOD_NONE;
    uint32_t *triangles = array_new(mesh.triangle_count, 3 * sizeof(uint32_t)), *next = triangles;
    if (!triangles)
        return tetlodi_fail_nomem(error, "the boundary", 12 * (uint64_t)mesh.triangle_count);
    for (size_t s = 0; s < 4 * (size_t)complex->tet_count; s++)
        for (int k = 0; k < 3 && complex->neighbours[s] == TETLOD_NONE; k++)
            *next++ = complex->corners[(s & ~(size_t)3) + tet_faces[s & 3][k]];
    mesh.triangles = triangles;
    enum tetlod_status status = clearance_find(&mesh, boundary->limit, least, 1, boundary->most, error);
    free(triangles);
    return status;
}

enum tetlod_status boundary_init(struct boundary *boundary, const struct complex *complex, double angle_degrees,
                                 double limit, double least, struct tetlod_error *error)
{
    size_t n = complex->vertex_count;
    *boundary = (struct boundary){.limit = limit,
                                  .kinds = array_zero(n, 1),
                                  .directions = array_zero(n, 3 * sizeof(float)),
                                  .moved = array_zero(n, sizeof(double)),
                                  .most = array_new(n, sizeof(double))};
    boundary_angle(angle_degrees, &boundary->cosine, &boundary->sine);
    enum tetlod_status status = TETLOD_OK;
    if (!boundary->kinds || !boundary->directions || !boundary->moved || !boundary->most)
        status = tetlodi_fail_nomem(error, "the boundary", n * 29);
    if (status == TETLOD_OK)
        status = find_most(boundary, complex, least, error);
    if (status != TETLOD_OK) {
        boundary_fini(boundary);
        return status;
    }
    for (uint32_t v = 0; v < n; v++)
        if (complex->flags[v] & VERTEX_BOUNDARY)
            classify(boundary, complex, v);
    return TETLOD_OK;
}

void boundary_fini(struct boundary *boundary)
{
    free(boundary->kinds);
    free(boundary->directions);
    free(boundary->moved);
    free(boundary->most);
    *boundary = (struct boundary){0};
}

void boundary_renumber(struct boundary *boundary, const struct renumbering *slots)
{
    renumber_array(&boundary->kinds, sizeof *boundary->kinds, slots);
    renumber_array(&boundary->directions, 3 * sizeof *boundary->directions, slots);
    renumber_array(&boundary->moved, sizeof *boundary->moved, slots);
    renumber_array(&boundary->most, sizeof *boundary->most, slots);
}

static bool vertex_may_move(const struct boundary *boundary, const struct complex *complex, uint32_t v,
                            const double p[3])
{
    double step[3];
    subtract(p, complex->positions + 3 * (size_t)v, step);
    return boundary_step_allowed(boundary->kinds[v], boundary->directions + 3 * (size_t)v, boundary->sine, boundary->limit, step);
}

bool boundary_allows(const struct boundary *boundary, const struct complex *complex, const struct star *star,
                     const double weights[4], const double p[3])
{
    bool touches = false;
    uint32_t fixed = 0;
    for (uint32_t s = 0; s < star->simplex_count; s++) {
        uint32_t v = star->simplex[s];
        touches |= complex->flags[v] & VERTEX_BOUNDARY;
        fixed += (complex->flags[v] & VERTEX_FIXED) != 0;
        if (complex->flags[v] & VERTEX_FIXED && (fixed > 1 || distance_squared(complex->positions + 3 * (size_t)v, p) != 0))
            return false;
    }
    for (uint32_t s = 0; s < star->simplex_count && touches; s++) {
        uint32_t v = star->simplex[s];
        if (complex->flags[v] & VERTEX_BOUNDARY ? !vertex_may_move(boundary, complex, v, p) : weights[s] != 0)
            return false;
    }
    return true;
}

void boundary_follow(const struct boundary *boundary, const struct complex *complex, const struct star *star,
                     double vector[3])
{
    for (uint32_t s = 0; s < star->simplex_count; s++) {
        uint32_t v = star->simplex[s];
        const float *d = boundary->directions + 3 * (size_t)v;
        if (!(complex->flags[v] & VERTEX_BOUNDARY))
            continue;
        double along = d[0] * vector[0] + d[1] * vector[1] + d[2] * vector[2];
        for (int i = 0; i < 3; i++)
            vector[i] = boundary->kinds[v] == BOUNDARY_SMOOTH   ? vector[i] - along * d[i]
                        : boundary->kinds[v] == BOUNDARY_CREASE ? along * d[i]
                                                                : 0;
    }
}

bool boundary_find_map(const struct complex *complex, const struct star *star, const double p[3], double cosine,
                       struct boundary_map *map)
{
    boundary_map_begin(map, complex->positions, 3, star->simplex, star->simplex_count, p);
    for (uint32_t i = 0; i < star->tet_count; i++)
        for (unsigned f = 0; f < 4; f++)
            if (complex_boundary_face(complex, star->tets[i], f) && star->moving[i] != f)
                boundary_map_add_face(map, complex->corners + 4 * (size_t)star->tets[i], f);
    return boundary_map_find(map, cosine);
}

double boundary_moves(const struct boundary *boundary, const struct complex *complex, const struct star *star,
                      const double p[3], struct boundary_map *map)
{
    if (!boundary_find_map(complex, star, p, boundary->cosine, map))
        return INFINITY;
    return boundary_map_moved(map, boundary->moved, 1, boundary->most, boundary->limit);
}

void boundary_update(struct boundary *boundary, const struct complex *complex, uint32_t vertex, double moved, double most)
{
    if (!(complex->flags[vertex] & VERTEX_BOUNDARY))
        return;
    const uint32_t *tets = complex->pool + complex->star_begin[vertex];
    boundary->moved[vertex] = moved;
    boundary->most[vertex] = most;
    classify(boundary, complex, vertex);
    for (uint32_t i = 0; i < complex->star_count[vertex]; i++)
        for (unsigned f = 0; f < 4; f++) {
            const uint32_t *corners = complex->corners + 4 * (size_t)tets[i];
            if (!complex_boundary_face(complex, tets[i], f) || corners[f] == vertex)
                continue;
            for (int k = 0; k < 3; k++)
                if (corners[tet_faces[f][k]] != vertex)
                    classify(boundary, complex, corners[tet_faces[f][k]]);
        }
}
