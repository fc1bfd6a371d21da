/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/overlay_levels.h"

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
#include "src/util/array.h"

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
    float *depths;            /* [tet of the original] no point of it is nearer to the boundary; NULL: not asked yet */
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
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

enum tetlod_status overlay_levels_new(struct overlay_levels **out, const struct tetmesh *original,
                                      const struct coarsening *coarsening, unsigned threads, struct tetlod_error *error)
{
    uint32_t fields = original->field_count;
    size_t tets = original->tet_count;
    struct overlay_levels *levels = array_zero(1, sizeof *levels);
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
        !levels->fields ||
        !levels->numbers || !levels->most) {
        overlay_levels_free(levels);
        return tetlodi_fail_nomem(error, "the overlay", overlay_levels_bytes(original));
    }
    sheets_bodies(original->corners, original->tet_count, original->vertex_count, levels->bodies);
    levels->orientation = sheets_promised(original->positions, original->corners, coarsening->neighbours,
                                          original->tet_count,
                                          levels->promised);
    for (uint32_t f = 0; f < fields; f++)
        levels->numbers[f] = f;
    enum tetlod_status status = clusters_build(&levels->clusters, original, error);
    if (status != TETLOD_OK) {
        overlay_levels_free(levels);
        return status;
    }
    *out = levels;
    return TETLOD_OK;
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

static enum tetlod_status fill_depths(struct overlay_levels *levels, const struct mesh_surface *surface,
                                      struct tetlod_error *error)
{
    const struct tetmesh *mesh = levels->original;
    double *distances = array_new(mesh->vertex_count, sizeof *distances);
    if (!distances)
        return tetlodi_fail_nomem(error, "the overlay", mesh->vertex_count * (uint64_t)sizeof *distances);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        struct place place;
        uint32_t face;
        distances[v] = mesh_surface_closest(surface, 0, mesh->positions + 3 * (size_t)v, &place, &face);
    }
    for (uint32_t t = 0; t < mesh->tet_count; t++) {
        double depth = 0, size = sqrt(tet_size_squared(mesh_corner(mesh, t, 0), mesh_corner(mesh, t, 1),
                                                       mesh_corner(mesh, t, 2), mesh_corner(mesh, t, 3)));
        for (int c = 0; c < 4; c++)
            depth = larger(depth, distances[mesh->corners[4 * (size_t)t + (size_t)c]] - size);
        levels->depths[t] = (float)(depth * (1 - 1e-6));
    }
    free(distances);
    return TETLOD_OK;
}

/* A lower bound of how far each tetrahedron of the original is from its boundary. */
static enum tetlod_status find_depths(struct overlay_levels *levels, struct tetlod_error *error)
{
    const struct tetmesh *mesh = levels->original;
    struct mesh_surface surface = {0};
    uint32_t *neighbours = array_new(mesh->tet_count, 4 * sizeof *neighbours);
    enum tetlod_status status = TETLOD_OK;
    levels->depths = array_new(mesh->tet_count, sizeof *levels->depths);
    levels->near = array_new(mesh->tet_count, 1);
    if (!neighbours || !levels->depths || !levels->near)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the overlay", 21 * (uint64_t)mesh->tet_count));
    TETLOD_TRY_DONE(adjacency_build(mesh->corners, mesh->tet_count, mesh->vertex_count, neighbours, NULL, error));
    TETLOD_TRY_DONE(mesh_surface_init(&surface, mesh->positions, mesh->corners, neighbours, mesh->tet_count, NULL, 0,
                                      0, error));
    status = fill_depths(levels, &surface, error);
done:
    mesh_surface_fini(&surface);
    free(neighbours);
    return status;
}

/* Of the wanted tetrahedra, those that may come within `reach` of the boundary stay wanted. The original's boundary is
 * no further than `reach` from the level's. */
static enum tetlod_status keep_near_boundary(struct overlay_levels *levels, const struct coarsening *mesh,
                                             const struct tetmesh *level, double reach, struct tetlod_error *error)
{
    struct mesh_surface surface;
    TETLOD_TRY(mesh_surface_init(&surface, mesh->positions, mesh->corners, mesh->neighbours, mesh->stored,
                                 mesh->states, COARSE_SAME, COARSE_CHANGED, error));
    for (uint32_t t = 0; t < level->tet_count; t++) {
        double box[6];
        tet_box(level, t, box);
        for (int d = 0; d < 3; d++) {
            box[d] -= reach;
            box[d + 3] += reach;
        }
        levels->wanted[t] = levels->wanted[t] && bvh_find_box(&surface.boxes, box, NULL, 0) > 0;
    }
    mesh_surface_fini(&surface);
    if (!levels->depths)
        TETLOD_TRY(find_depths(levels, error));
    for (uint32_t t = 0; t < levels->original->tet_count; t++)
        levels->near[t] = levels->promised[t] && levels->depths[t] <= 2 * reach;
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
