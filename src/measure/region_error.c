/* SPDX-License-Identifier: BSD-3-Clause */
/* The overlay is of the belt and of those finest tetrahedra whose bounding boxes touch a cell, of a grid, that one of the belt's touches. */
#include "src/measure/region_error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/measure/overlay.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

enum { CELLS = 64 }; /* along an axis */

struct cells {
    double low[3], scale[3];
    unsigned char *marked; /* [CELLS ^ 3] */
};

static void bounds_of(const double *positions, const uint32_t *corners, double low[3], double high[3])
{
    for (int i = 0; i < 3; i++) {
        low[i] = INFINITY;
        high[i] = -INFINITY;
        for (int c = 0; c < 4; c++) {
            double at = positions[3 * (size_t)corners[c] + (size_t)i];
            low[i] = smaller(low[i], at);
            high[i] = larger(high[i], at);
        }
    }
}

static int cell_at(const struct cells *cells, double at, int axis)
{
    double cell = (at - cells->low[axis]) * cells->scale[axis];
    return cell > 0 ? cell < CELLS ? (int)cell : CELLS - 1 : 0;
}

/* Marks the cells of a box, or tells whether one of them is marked. */
static bool visit(const struct cells *cells, const double low[3], const double high[3], bool mark)
{
    for (int x = cell_at(cells, low[0], 0); x <= cell_at(cells, high[0], 0); x++)
        for (int y = cell_at(cells, low[1], 1); y <= cell_at(cells, high[1], 1); y++)
            for (int z = cell_at(cells, low[2], 2); z <= cell_at(cells, high[2], 2); z++) {
                unsigned char *cell = &cells->marked[(x * CELLS + y) * CELLS + z];
                if (mark)
                    *cell = 1;
                else if (*cell)
                    return true;
            }
    return false;
}

static enum tetlod_status mark_cells(struct cells *cells, const struct tetmesh *belt, struct tetlod_error *error)
{
    double all[2][3] = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}, low[3], high[3];
    cells->marked = array_zero((size_t)CELLS * CELLS * CELLS, 1);
    if (!cells->marked)
        return tetlodi_fail_nomem(error, "a region's error", (uint64_t)CELLS * CELLS * CELLS);
    for (uint32_t t = 0; t < belt->tet_count; t++) {
        bounds_of(belt->positions, belt->corners + 4 * (size_t)t, low, high);
        for (int i = 0; i < 3; i++) {
            all[0][i] = smaller(all[0][i], low[i]);
            all[1][i] = larger(all[1][i], high[i]);
        }
    }
    for (int i = 0; i < 3; i++) {
        cells->low[i] = all[0][i];
        cells->scale[i] = all[1][i] > all[0][i] ? CELLS / (all[1][i] - all[0][i]) : 0;
    }
    for (uint32_t t = 0; t < belt->tet_count; t++) {
        bounds_of(belt->positions, belt->corners + 4 * (size_t)t, low, high);
        visit(cells, low, high, true);
    }
    return TETLOD_OK;
}

/* The belt as a mesh that borrows all but its corners. */
static enum tetlod_status take_belt(const struct tetmesh *mesh, struct tetmesh *out, struct tetlod_error *error)
{
    const double *parts = mesh->cell_fields[tetmesh_find_cell_field(mesh, REGION_FIELD)].values;
    *out = *mesh;
    out->cell_field_count = 0;
    out->tet_count = 0;
    out->corners = array_new(mesh->tet_count, 4 * sizeof *out->corners);
    if (!out->corners)
        return tetlodi_fail_nomem(error, "a region's error", (uint64_t)mesh->tet_count * 16);
    for (size_t t = 0; t < mesh->tet_count; t++)
        if (parts[t] == (double)REGION_BELT)
            memcpy(out->corners + 4 * (size_t)out->tet_count++, mesh->corners + 4 * t, 16);
    return TETLOD_OK;
}

/* Takes the finest tetrahedra in marked cells; `numbers` has room for a number of each vertex. */
static enum tetlod_status take_tets(const struct forest_view *view, const struct tetlod_level *level, const struct cells *cells,
                                    const double *positions, uint32_t *numbers, struct tetmesh *out, struct tetlod_error *error)
{
    size_t capacity = 0;
    memset(numbers, 0xff, level->vertices * sizeof *numbers);
    for (uint32_t t = 0; t < level->tets; t++) {
        uint32_t corners[4];
        double low[3], high[3];
        forest_view_corners(view, t, 1, corners);
        bounds_of(positions, corners, low, high);
        if (!visit(cells, low, high, false))
            continue;
        if (!array_reserve((void **)&out->corners, &capacity, (size_t)out->tet_count + 1, 4 * sizeof *out->corners))
            return tetlodi_fail_nomem(error, "a region's error", (uint64_t)out->tet_count * 16);
        for (size_t c = 0; c < 4; c++) {
            if (numbers[corners[c]] == TETLOD_NONE)
                numbers[corners[c]] = out->vertex_count++;
            out->corners[4 * (size_t)out->tet_count + c] = numbers[corners[c]];
        }
        out->tet_count++;
    }
    return TETLOD_OK;
}

static enum tetlod_status take_vertices(const struct forest_view *view, const struct tetlod_level *level, const struct tetmesh *mesh,
                                        const uint32_t *numbers, struct tetmesh *out, struct tetlod_error *error)
{
    out->position_type = mesh->position_type;
    out->positions = array_new(out->vertex_count, 3 * sizeof *out->positions);
    if (!out->positions)
        return tetlodi_fail_nomem(error, "a region's error", (uint64_t)out->vertex_count * 24);
    for (uint32_t f = 0; f < mesh->field_count; f++)
        TETLOD_TRY(tetmesh_add_field(out, mesh->fields[f].name, mesh->fields[f].components, mesh->fields[f].type, error));
    for (uint32_t v = 0; v < level->vertices; v++) {
        if (numbers[v] == TETLOD_NONE)
            continue;
        forest_view_values(view, 0, v, 1, out->positions + 3 * (size_t)numbers[v]);
        for (uint32_t f = 0; f < out->field_count; f++)
            forest_view_values(view, 1 + f, v, 1, out->fields[f].values + (size_t)out->fields[f].components * numbers[v]);
    }
    return TETLOD_OK;
}

/* The part of the finest level that may overlap the belt. */
static enum tetlod_status take_finest(const struct forest *forest, const struct cells *cells, const struct tetmesh *mesh,
                                      struct tetmesh *out, struct tetlod_error *error)
{
    const struct tetlod_info *info = forest_info(forest);
    const struct tetlod_level *level = &info->levels[info->level_count - 1];
    double *positions = array_new(level->vertices, 3 * sizeof *positions);
    uint32_t *numbers = array_new(level->vertices, sizeof *numbers);
    struct forest_view *view = NULL;
    enum tetlod_status status = positions && numbers ? forest_view_new(&view, forest, info->level_count - 1, error)
                                                     : tetlodi_fail_nomem(error, "a region's error", level->vertices * (uint64_t)28);
    if (status == TETLOD_OK) {
        forest_view_values(view, 0, 0, level->vertices, positions);
        status = take_tets(view, level, cells, positions, numbers, out, error);
    }
    if (status == TETLOD_OK)
        status = take_vertices(view, level, mesh, numbers, out, error);
    forest_view_free(view);
    free(positions);
    free(numbers);
    return status;
}

enum tetlod_status region_error(const struct forest *forest, const struct tetmesh *mesh, unsigned threads, double *out,
                                struct tetlod_error *error)
{
    struct tetmesh belt, finest = {0};
    struct cells cells = {{0}, {0}, NULL};
    struct overlay_report report;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        out[f] = 0;
    TETLOD_TRY(take_belt(mesh, &belt, error));
    uint32_t count = 0, *fields = array_new(mesh->field_count, sizeof *fields);
    double *most = array_new(mesh->field_count, sizeof *most);
    enum tetlod_status status = fields && most ? TETLOD_OK : tetlodi_fail_nomem(error, "a region's error", mesh->field_count);
    for (uint32_t f = 0; fields && f < mesh->field_count; f++)
        if (forest_info(forest)->fields[f].controlled)
            fields[count++] = f;
    if (status == TETLOD_OK && belt.tet_count && count) {
        status = mark_cells(&cells, &belt, error);
        if (status == TETLOD_OK)
            status = take_finest(forest, &cells, mesh, &finest, error);
        if (status == TETLOD_OK)
            status = overlay_max(&belt, fields, &finest, fields, count, &(struct overlay_options){.threads = threads}, most, &report, error);
        for (uint32_t i = 0; status == TETLOD_OK && i < count; i++)
            out[fields[i]] = most[i];
    }
    tetmesh_fini(&finest);
    free(cells.marked);
    free(belt.corners);
    free(fields);
    free(most);
    return status;
}
