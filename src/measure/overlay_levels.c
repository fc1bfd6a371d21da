/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/overlay_levels.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/overlay.h"
#include "src/measure/weights_map.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/mesh_surface.h"
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/util/array.h"

/* A depth of what is near the boundary. */
static const double NEAR = -1;

struct overlay_levels {
    const struct tetmesh *original;
    unsigned threads;
    bool started;
    int orientation;
    uint32_t *bodies;         /* [slot] */
    uint8_t *promised;        /* [tet of the original] */
    uint32_t *corners;        /* [4 * tet of the level] */
    uint8_t *usable, *wanted; /* [tet of the level] */
    struct point_field *fields;
    uint32_t *numbers;        /* [field] */
    double *most;             /* [field] */
    struct clusters clusters; /* of the original */
    struct mesh_surface boundary; /* of the original; empty until it is asked for */
    double *depths;           /* [tet of the original] it is further than that from the boundary; or NEAR */
    double reach;             /* the largest that was asked for: which are NEAR */
    uint8_t *near;            /* [tet of the original] promised, and near enough to the boundary */
};

uint64_t overlay_levels_bytes(const struct tetmesh *original)
{
    return (uint64_t)original->tet_count * (16 + 3 + 48 + 2 + 5 + 16) + clusters_bytes(original->tet_count) +
           (uint64_t)original->vertex_count * 4;
}

void overlay_levels_free(struct overlay_levels *levels)
{
    if (!levels)
        return;
    void *const owned[] = {levels->bodies, levels->promised, levels->corners, levels->usable, levels->wanted,
                           levels->fields, levels->numbers,  levels->most,    levels->depths,
                           levels->near,   levels};
    clusters_fini(&levels->clusters);
    mesh_surface_fini(&levels->boundary);
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

enum tetlod_status overlay_levels_new(struct overlay_levels **out, const struct tetmesh *original,
                                      struct coarsening *coarsening, unsigned threads, struct tetlod_error *error)
{
    uint32_t fields = original->field_count;
    size_t tets = original->tet_count;
    struct overlay_levels *levels = array_zero(1, sizeof *levels);
    enum tetlod_status status = TETLOD_OK;
    *out = NULL;
    if (!levels)
        return tetlodi_fail_nomem(error, "the overlay", sizeof *levels);
    *levels = (struct overlay_levels){.original = original,
                                      .threads = threads,
                                      .bodies = array_new(original->vertex_count, sizeof(uint32_t)),
                                      .promised = array_new(tets, 1),
                                      .corners = array_new(tets, 4 * sizeof(uint32_t)),
                                      .usable = array_new(tets, 1),
                                      .wanted = array_new(tets, 1),
                                      .fields = array_zero(fields, sizeof(struct point_field)),
                                      .numbers = array_new(fields, sizeof(uint32_t)),
                                      .most = array_new(fields, sizeof(double))};
    if (!levels->bodies || !levels->promised || !levels->corners || !levels->usable || !levels->wanted ||
        !levels->fields || !levels->numbers || !levels->most)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the overlay", overlay_levels_bytes(original)));
    TETLOD_TRY_DONE(coarsening_need_neighbours(coarsening, error));
    sheets_bodies(original->corners, original->tet_count, original->vertex_count, levels->bodies);
    levels->orientation = sheets_promised(original->positions, original->corners, coarsening->neighbours,
                                          original->tet_count,
                                          levels->promised);
    for (uint32_t f = 0; f < fields; f++)
        levels->numbers[f] = f;
    TETLOD_TRY_DONE(clusters_build(&levels->clusters, original, error));
    *out = levels;
done:
    if (status != TETLOD_OK)
        overlay_levels_free(levels);
    return status;
}

/* The tetrahedra that are there, and which of them changed: at first all may be other than the original's. */
static void take_level(struct overlay_levels *levels, const struct coarsening *mesh, struct tetmesh *out)
{
    for (size_t t = 0; t < mesh->stored; t++) {
        const uint32_t *c = mesh->corners + 4 * t;
        const double *p[4];
        size_t at = out->tet_count;
        if (mesh->states[t] >= COARSE_DIED)
            continue;
        for (int i = 0; i < 4; i++)
            p[i] = mesh->positions + 3 * (size_t)c[i];
        memcpy(levels->corners + 4 * at, c, 4 * sizeof *c);
        levels->usable[at] = tet_orientation(p[0], p[1], p[2], p[3]) == levels->orientation;
        levels->wanted[at] = !levels->started || mesh->states[t] == COARSE_CHANGED;
        out->tet_count++;
    }
    for (uint32_t f = 0; f < mesh->field_count; f++)
        levels->fields[f] = (struct point_field){.components = mesh->fields[f].components,
                                                 .values = mesh->fields[f].values};
}

static enum tetlod_status need_boundary(struct overlay_levels *levels, struct tetlod_error *error)
{
    const struct tetmesh *mesh = levels->original;
    if (levels->depths)
        return TETLOD_OK;
    uint32_t *neighbours = array_new(mesh->tet_count, 4 * sizeof *neighbours);
    enum tetlod_status status = TETLOD_OK;
    levels->depths = array_zero(mesh->tet_count, sizeof *levels->depths);
    levels->near = array_new(mesh->tet_count, 1);
    if (!neighbours || !levels->depths || !levels->near)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the overlay", 25 * (uint64_t)mesh->tet_count));
    TETLOD_TRY_DONE(adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL, error));
    status = mesh_surface_init(&levels->boundary, mesh->positions, mesh->corners, neighbours, mesh->tet_count, NULL, 0,
                               0, error);
done:
    free(neighbours);
    return status;
}

/* Are three points further than `reach` in front of a face of the tetrahedron, rounding aside? */
static bool is_beyond(const double *const corners[4], const double *const points[3], double reach)
{
    for (int f = 0; f < 4; f++) {
        const double *q = corners[tet_faces[f][0]];
        double u[3], v[3], normal[3], inwards[3], nearest = INFINITY, farthest2 = 0;
        subtract(corners[tet_faces[f][1]], q, u);
        subtract(corners[tet_faces[f][2]], q, v);
        subtract(corners[f], q, inwards);
        cross(u, v, normal);
        bool positive = dot(normal, inwards) > 0;
        for (int i = 0; i < 3; i++) {
            double r[3];
            subtract(points[i], q, r);
            nearest = smaller(nearest, positive ? -dot(normal, r) : dot(normal, r));
            farthest2 = larger(farthest2, dot(r, r));
        }
        farthest2 = larger(farthest2, dot(inwards, inwards));
        if (nearest > reach * sqrt(dot(normal, normal)) + 64 * DBL_EPSILON * sqrt(dot(u, u) * dot(v, v) * farthest2))
            return true;
    }
    return false;
}

/* May a face of the surface be within `reach` of the tetrahedron? */
static bool is_within(const struct mesh_surface *surface, const struct tetmesh *mesh, uint32_t tet, double reach)
{
    const double *corners[4], wide = reach * (1 + 1e-6);
    double box[6];
    uint32_t first, end;
    tet_box(mesh, tet, box);
    for (int i = 0; i < 4; i++)
        corners[i] = mesh_corner(mesh, tet, i);
    for (int d = 0; d < 3; d++) {
        box[d] -= wide;
        box[d + 3] += wide;
    }
    struct bvh_walk walk = bvh_walk_begin(&surface->boxes);
    while (bvh_next_leaf(&walk, box, &first, &end))
        for (uint32_t i = first; i < end; i++) {
            const uint32_t *triangle = surface->triangles + 3 * (size_t)surface->boxes.order[i];
            const double *points[3];
            bool meets = true;
            for (int k = 0; k < 3; k++)
                points[k] = surface->positions + 3 * (size_t)triangle[k];
            for (int d = 0; d < 3; d++)
                meets &= smaller(smaller(points[0][d], points[1][d]), points[2][d]) <= box[d + 3] &&
                         larger(larger(points[0][d], points[1][d]), points[2][d]) >= box[d];
            if (meets && !is_beyond(corners, points, wide))
                return true;
        }
    return false;
}

/* Those of the original that may come within `reach` of its boundary. What is further away is asked about again only
 * when the reach has grown to twice that. */
static void find_near(struct overlay_levels *levels, double reach)
{
    const struct tetmesh *mesh = levels->original;
    levels->reach = larger(levels->reach, reach);
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        double *depth = &levels->depths[t];
        if (*depth != NEAR && *depth <= levels->reach && levels->promised[t])
            *depth = !is_within(&levels->boundary, mesh, t, 2 * levels->reach) ? 2 * levels->reach :
                is_within(&levels->boundary, mesh, t, levels->reach) ? NEAR : levels->reach;
        levels->near[t] = levels->promised[t] && *depth == NEAR;
    }
}

/* Of the wanted tetrahedra, those that may come within `reach` of the boundary stay wanted. The original's boundary is
 * no further than `reach` from the level's. */
static enum tetlod_status keep_near_boundary(struct overlay_levels *levels, const struct coarsening *mesh,
                                             const struct tetmesh *level, double reach, struct tetlod_error *error)
{
    struct mesh_surface surface;
    TETLOD_TRY(mesh_surface_init(&surface, mesh->positions, mesh->corners, mesh->neighbours, mesh->stored,
                                 mesh->states, COARSE_SAME, COARSE_CHANGED, error));
    for (uint32_t t = 0; t < level->tet_count; t++)
        levels->wanted[t] = levels->wanted[t] && is_within(&surface, level, t, reach);
    mesh_surface_fini(&surface);
    TETLOD_TRY(need_boundary(levels, error));
    find_near(levels, 2 * reach);
    return TETLOD_OK;
}

/* Is the finest level the original to the last bit? Then it has no difference. */
static bool is_original(const struct overlay_levels *levels, const struct coarsening *finest)
{
    const struct tetmesh *original = levels->original;
    size_t vertices = original->vertex_count;
    bool same = finest->stored == original->tet_count &&
                !memcmp(finest->positions, original->positions, 3 * vertices * sizeof(double)) &&
                !memcmp(finest->corners, original->corners, 4 * finest->stored * sizeof(uint32_t));
    for (uint32_t f = 0; f < original->field_count && same; f++)
        same = !memcmp(finest->fields[f].values, original->fields[f].values,
                       vertices * original->fields[f].components * sizeof(double));
    return same;
}

enum tetlod_status overlay_levels_next(struct overlay_levels *levels, const struct coarsening *coarsening,
                                       double reach, double *io_most, struct tetlod_error *error)
{
    const struct tetmesh *original = levels->original;
    struct tetmesh level = {.vertex_count = coarsening->slot_count, .positions = coarsening->positions,
                            .corners = levels->corners,
                            .field_count = coarsening->field_count, .fields = levels->fields};
    bool known = reach == 0 || (!levels->started && is_original(levels, coarsening));
    if (!known)
        take_level(levels, coarsening, &level);
    levels->started = true;
    if (known)
        return TETLOD_OK;
    if (isfinite(reach))
        TETLOD_TRY(keep_near_boundary(levels, coarsening, &level, reach, error));
    const struct overlay_options options = {.threads = levels->threads,
                                            .bodies = {levels->bodies, levels->bodies},
                                            .usable = {isfinite(reach) ? levels->near : levels->promised,
                                                       levels->usable},
                                            .wanted = levels->wanted,
                                            .clusters = &levels->clusters,
                                            .floors = io_most};
    struct overlay_report report;
    TETLOD_TRY(overlay_max(original, levels->numbers, &level, levels->numbers, original->field_count, &options,
                           levels->most,
                           &report, error));
    memcpy(io_most, levels->most, original->field_count * sizeof *io_most);
    return TETLOD_OK;
}
