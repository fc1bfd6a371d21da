/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/level_fuzz.h"

#include <stdlib.h>
#include <string.h>

#include "format/write/prefix.h"
#include "src/stream/forest.h"
#include "src/stream/region.h"
#include "src/stream/level_mesh.h"
#include "tests/memory_sink.h"

enum { MAX_ROWS = 1 << 16, MAX_LEVELS = 64, MAX_STEPS = 10, MAX_GROUPS = 4 };

static void demand(int condition)
{
    if (!condition)
        abort();
}

/* Corners in range and numbers finite: as every mesh that comes out of a stream. */
static void check(const struct tetmesh *mesh)
{
    demand(!mesh->tet_count || tetmesh_validate(mesh, NULL) == TETLOD_OK);
}

/* Adds the values of cells, and goes into the original order: a mesh, or an error. */
static void finish(const struct tetlod_file *file, struct tetmesh *mesh)
{
    enum tetlod_status status = level_mesh_cells(file, TETLOD_NONE, NULL, mesh, NULL);
    if (status == TETLOD_OK)
        status = level_mesh_reorder(file, mesh, NULL);
    if (status == TETLOD_OK)
        check(mesh);
    tetmesh_fini(mesh);
}

static void check_finest(struct tetlod_file *file, const struct tetlod_info *info)
{
    struct tetlod_cursor *cursor;
    struct tetmesh mesh;
    if (tetlod_cursor_new(&cursor, file, NULL, 0, NULL) != TETLOD_OK)
        return;
    if (tetlod_cursor_seek(cursor, info->level_count - 1, NULL) == TETLOD_OK &&
        level_mesh_take(info, &cursor, &mesh, NULL) == TETLOD_OK)
        finish(file, &mesh);
    tetlod_cursor_free(cursor);
}

static void check_step(struct tetlod_file *file, struct tetlod_series *series, struct tetlod_cursor *cursor,
                       uint32_t band, uint32_t step)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetmesh mesh;
    if (tetlod_seek_step(series, cursor, band, step, NULL) != TETLOD_OK)
        return;
    demand(tetlod_step_error(series, 0, band, step) >= 0);
    demand(level_mesh_copy(info, cursor, &mesh, NULL) == TETLOD_OK);
    demand(level_mesh_step(info, series, &mesh, NULL) == TETLOD_OK);
    if (tetlod_step_move(series, mesh.positions, NULL) == TETLOD_OK)
        check(&mesh);
    finish(file, &mesh);
}

static void check_steps(struct tetlod_file *file)
{
    static const uint32_t none[1] = {0};
    struct tetlod_series *series = NULL;
    struct tetlod_cursor *cursor = NULL;
    if (tetlod_series_new(&series, file, NULL) == TETLOD_OK &&
        tetlod_cursor_new(&cursor, file, none, 0, NULL) == TETLOD_OK) {
        const struct tetlod_series_info *info = tetlod_series_info(series);
        for (uint32_t b = 0; b < info->band_count && b < 4; b++)
            for (uint32_t s = 0; s < info->step_count && s < MAX_STEPS; s++)
                check_step(file, series, cursor, b, s);
    }
    tetlod_cursor_free(cursor);
    tetlod_series_free(series);
}

/* The coarsest level with the finest that is there, in the middle eighth of the bounds. */
static void check_region(const struct forest *forest, uint32_t fine)
{
    const struct tetlod_info *info = forest_info(forest);
    struct region_box box;
    struct region_counts counts;
    struct tetmesh mesh;
    uint32_t *tets;
    for (int i = 0; i < 3; i++) {
        double low = info->bounds[0][i] / 2, high = info->bounds[1][i] / 2;
        box.low[i] = low + (low + high) / 2;
        box.high[i] = high + (low + high) / 2;
    }
    const struct region region = {.fine = fine, .boxes = &box, .box_count = 1};
    if (region_mesh(forest, &region, NULL, &mesh, &tets, &counts, NULL) != TETLOD_OK)
        return;
    check(&mesh);
    for (uint32_t t = 0; t < mesh.tet_count; t++)
        demand(tets[t] < info->levels[fine].tets);
    free(tets);
    tetmesh_fini(&mesh);
}

static void check_forest(struct tetlod_file *file, const struct tetlod_info *info)
{
    struct forest *forest;
    struct tetmesh mesh;
    if (info->vertices > MAX_ROWS || forest_new(&forest, file, 0, NULL) != TETLOD_OK)
        return;
    for (uint32_t k = 0; k <= forest_last_level(info, 0) && k < MAX_LEVELS; k++)
        if (forest_grow(forest, NULL) != TETLOD_OK)
            break;
    for (uint32_t k = 0, count = forest_levels(forest); k < count; k += 1 + count / 4) {
        demand(forest_mesh(forest, k, &mesh, NULL) == TETLOD_OK);
        demand(mesh.vertex_count == info->levels[k].vertices && mesh.tet_count == info->levels[k].tets);
        check(&mesh);
        tetmesh_fini(&mesh);
    }
    if (forest_levels(forest) > 1)
        check_region(forest, forest_levels(forest) - 1);
    forest_free(forest);
}

/* What is written is a stream of so many levels. */
static void check_prefix(const struct tetlod_file *file, uint32_t level)
{
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct tetlod_file *again;
    if (tetlodi_write_prefix(file, level, &sink, NULL) == TETLOD_OK &&
        tetlod_open_memory(&again, memory.bytes, memory.size, NULL, NULL) == TETLOD_OK) {
        demand(tetlod_info(again)->level_count == level + 1);
        tetlod_close(again);
    }
    free(memory.bytes);
}

void level_fuzz(struct tetlod_file *file)
{
    const struct tetlod_info *info = tetlod_info(file);
    if (info->tets > MAX_ROWS)
        return;
    check_finest(file, info);
    check_steps(file);
    check_forest(file, info);
    check_prefix(file, info->level_count / 2);
    for (uint32_t t = 1; t < info->topology_count && t < MAX_GROUPS; t++) {
        struct tetlod_file *group;
        if (tetlod_open_topology(&group, file, t, NULL) != TETLOD_OK)
            continue;
        level_fuzz(group);
        tetlod_close(group);
    }
}
