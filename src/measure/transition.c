/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/measure/transition.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/sheets.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

void finest_part_fini(struct finest_part *part)
{
    tetmesh_fini(&part->mesh);
    free(part->bodies);
}

void transition_fini(struct transition *t)
{
    void *const owned[] = {t->fields.fields,  t->fields.places, t->fields.of,     t->tets.corners,
                           t->near.corners,   t->wanted,        t->bodies,        t->finest.cells,
                           t->finest.corners, t->finest.bodies, t->finest.values, t->finest.positions};
    value_grid_fini(&t->grid);
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
}

/* ---- what is compared ---- */

static bool has_local_bound(const struct tetlod_info *info, uint32_t field)
{
    for (uint32_t f = 0; f < info->field_count; f++)
        if (info->fields[f].bounds == field)
            return true;
    return false;
}

static bool list_fields(const struct tetlod_info *info, struct transition_fields *out)
{
    uint32_t components = 0;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    out->fields = array_new(info->field_count, sizeof *out->fields);
    out->places = array_new(info->field_count, sizeof *out->places);
    out->of = array_new(components, sizeof *out->of);
    if (!out->fields || !out->places || !out->of)
        return false;
    for (uint32_t f = 0; f < info->field_count; f++) {
        if (!info->fields[f].controlled && !has_local_bound(info, f))
            continue;
        for (uint32_t c = 0; c < info->fields[f].components; c++)
            out->of[out->width++] = out->count;
        out->places[out->count] = out->count;
        out->fields[out->count++] = f;
    }
    return true;
}

static bool is_of_transition(const struct tetmesh *region, size_t tet)
{
    return region->cell_fields[tetmesh_find_cell_field(region, REGION_FIELD)].values[tet] == (double)REGION_TRANSITION;
}

/* A mesh for so many of the region's tetrahedra. */
static enum tetlod_status borrow(const struct transition *t, size_t tets, struct tetmesh *out,
                                 struct tetlod_error *error)
{
    *out = *t->region;
    out->cell_field_count = 0;
    out->tet_count = 0;
    out->corners = NULL;
    TETLOD_TRY(room_take(t->room, tets * 4 * sizeof *out->corners, error));
    out->corners = array_new(tets, 4 * sizeof *out->corners);
    return out->corners ? TETLOD_OK : tetlodi_fail_nomem(error, "a region's error", tets * 4 * sizeof *out->corners);
}

static enum tetlod_status take_tets(struct transition *t, struct tetlod_error *error)
{
    size_t count = 0;
    for (size_t i = 0; i < t->region->tet_count; i++)
        count += is_of_transition(t->region, i);
    TETLOD_TRY(borrow(t, count, &t->tets, error));
    for (size_t i = 0; i < t->region->tet_count; i++)
        if (is_of_transition(t->region, i))
            memcpy(t->tets.corners + 4 * (size_t)t->tets.tet_count++, t->region->corners + 4 * i, 16);
    return TETLOD_OK;
}

/* The components of a field into rows of `width`. */
static void put_columns(const double *values, uint32_t components, size_t count, uint32_t width, double *out)
{
    for (size_t v = 0; v < count; v++)
        memcpy(out + v * width, values + v * components, components * sizeof *out);
}

static enum tetlod_status make_grid(struct transition *t, struct tetlod_error *error)
{
    uint32_t width = t->fields.width, column = 0;
    const uint64_t held = room_held(t->room), grid = value_grid_bytes(t->tets.tet_count, width);
    TETLOD_TRY(room_take(t->room, grid + (uint64_t)t->region->vertex_count * width * sizeof(double), error));
    double *rows = array_new(t->region->vertex_count, width * sizeof *rows);
    if (!rows)
        return tetlodi_fail_nomem(error, "a region's error", (uint64_t)t->region->vertex_count * width * 8);
    for (uint32_t i = 0; i < t->fields.count; i++) {
        const struct point_field *field = &t->region->fields[t->fields.fields[i]];
        put_columns(field->values, field->components, t->region->vertex_count, width, rows + column);
        column += field->components;
    }
    enum tetlod_status status = value_grid_init(&t->grid, &t->tets, rows, width, error);
    free(rows);
    room_back_to(t->room, held + grid);
    return status;
}

/* ---- the finest level ---- */

static void read_vertices(struct transition *t, const struct forest_view *view, uint32_t first, size_t count,
                          double *block)
{
    const struct tetlod_info *info = forest_info(t->forest);
    uint32_t width = t->fields.width;
    double *p = t->finest.positions + 3 * (size_t)first, *rows = t->finest.values + (size_t)width * first;
    forest_view_values(view, 0, first, count, p);
    for (uint32_t i = 0, column = 0; i < t->fields.count; i++) {
        uint32_t field = t->fields.fields[i];
        forest_view_values(view, 1 + field, first, count, block);
        put_columns(block, info->fields[field].components, count, width, rows + column);
        column += info->fields[field].components;
    }
    for (size_t v = 0; v < 3 * count; v++)
        t->finest.cells[first + v / 3][v % 3] = grid_coordinate(&t->grid, p[v], (int)(v % 3));
}

/* What take_finest leaves. */
static uint64_t finest_bytes(const struct tetlod_level *finest, uint32_t width)
{
    return finest->vertices * (uint64_t)((3 + width) * sizeof(double) + 3 + sizeof(uint32_t)) +
        finest->tets * (uint64_t)(4 * sizeof(uint32_t));
}

static enum tetlod_status take_finest(struct transition *t, struct tetlod_error *error)
{
    enum { BLOCK = 256 };
    const struct tetlod_info *info = forest_info(t->forest);
    const struct tetlod_level *level = &info->levels[info->level_count - 1];
    uint32_t vertices = level->vertices, width = t->fields.width;
    const uint64_t view_bytes = forest_view_bytes(t->forest,
                                                  info->level_count - 1) + BLOCK * (uint64_t)width * sizeof(double);
    struct forest_view *view;
    TETLOD_TRY(room_take(t->room, finest_bytes(level, width) + view_bytes, error));
    const uint64_t held = room_held(t->room) - view_bytes;
    double *block = array_new(BLOCK * (size_t)width, sizeof *block);
    t->finest = (struct finest){.vertices = vertices,
                                .tets = level->tets,
                                .positions = array_new(vertices, 3 * sizeof(double)),
                                .values = array_new(vertices, width * sizeof(double)),
                                .cells = array_new(vertices, sizeof *t->finest.cells),
                                .corners = array_new(level->tets, 4 * sizeof(uint32_t)),
                                .bodies = array_new(vertices, sizeof(uint32_t))};
    const struct finest *f = &t->finest;
    if (!block || !f->positions || !f->values || !f->cells || !f->corners || !f->bodies) {
        free(block);
        return tetlodi_fail_nomem(error, "a region's error",
                                  vertices * (uint64_t)(8 * width + 31) + level->tets * (uint64_t)16);
    }
    enum tetlod_status status = forest_view_new(&view, t->forest, info->level_count - 1, error);
    for (uint32_t first = 0; status == TETLOD_OK && first < vertices; first += BLOCK)
        read_vertices(t, view, first, vertices - first < BLOCK ? vertices - first : BLOCK, block);
    if (status == TETLOD_OK) {
        forest_view_corners(view, 0, level->tets, f->corners);
        sheets_bodies(f->corners, level->tets, vertices, f->bodies);
        forest_view_free(view);
    }
    free(block);
    room_back_to(t->room, held);
    return status;
}

/* ---- near the transition ---- */

/* The cells that a tetrahedron touches. */
struct span {
    int from[3], to[3];
};

static struct span span_of(const uint8_t cells[4][3])
{
    struct span span;
    for (int i = 0; i < 3; i++) {
        int low[2] = {cells[0][i] < cells[1][i] ? cells[0][i] : cells[1][i],
                      cells[2][i] < cells[3][i] ? cells[2][i] : cells[3][i]};
        int high[2] = {cells[0][i] > cells[1][i] ? cells[0][i] : cells[1][i],
                       cells[2][i] > cells[3][i] ? cells[2][i] : cells[3][i]};
        span.from[i] = low[0] < low[1] ? low[0] : low[1];
        span.to[i] = high[0] > high[1] ? high[0] : high[1];
    }
    return span;
}

static bool touches(const struct transition *t, const struct span *span)
{
    for (int x = span->from[0]; x <= span->to[0]; x++)
        for (int y = span->from[1]; y <= span->to[1]; y++)
            for (int z = span->from[2]; z <= span->to[2]; z++)
                if (t->grid.marked[grid_number(&t->grid, x, y, z)])
                    return true;
    return false;
}

static bool is_near(const struct transition *t, size_t tet)
{
    uint8_t cells[4][3];
    for (size_t c = 0; c < 4; c++)
        for (int i = 0; i < 3; i++)
            cells[c][i] = grid_coordinate(&t->grid,
                                          t->region->positions[3 * (size_t)t->region->corners[4 * tet + c] +
                                                               (size_t)i], i);
    struct span span = span_of((const uint8_t(*)[3])cells);
    return touches(t, &span);
}

/* Where the region covers a place more than once, the best of its values counts, whatever part it is of. */
static enum tetlod_status take_near(struct transition *t, const uint32_t *tets, struct tetlod_error *error)
{
    const struct tetmesh *region = t->region;
    size_t count = 0;
    for (size_t i = 0; i < region->tet_count; i++)
        count += is_of_transition(region, i) || is_near(t, i);
    TETLOD_TRY(borrow(t, count, &t->near, error));
    TETLOD_TRY(room_take(t->room, count + region->vertex_count * sizeof *t->bodies, error));
    t->wanted = array_new(count, 1);
    t->bodies = array_new(region->vertex_count, sizeof *t->bodies);
    if (!t->wanted || !t->bodies)
        return tetlodi_fail_nomem(error, "a region's error", count + region->vertex_count * sizeof *t->bodies);
    for (size_t i = 0; i < region->tet_count; i++) {
        bool wanted = is_of_transition(region, i);
        for (size_t c = 0; c < 4; c++)
            t->bodies[region->corners[4 * i + c]] = t->finest.bodies[t->finest.corners[4 * (size_t)tets[i]]];
        if (!wanted && !is_near(t, i))
            continue;
        memcpy(t->near.corners + 4 * (size_t)t->near.tet_count, region->corners + 4 * i, 16);
        t->wanted[t->near.tet_count++] = wanted;
    }
    return TETLOD_OK;
}

enum tetlod_status transition_init(struct transition *t, const struct forest *forest, const struct tetmesh *region,
                                   const uint32_t *tets, struct room *room, struct tetlod_error *error)
{
    *t = (struct transition){.forest = forest, .room = room, .region = region};
    if (!list_fields(forest_info(forest), &t->fields))
        return tetlodi_fail_nomem(error, "a region's error", forest_info(forest)->field_count * sizeof(uint32_t));
    TETLOD_TRY(take_tets(t, error));
    if (!t->tets.tet_count || !t->fields.count)
        return TETLOD_OK;
    TETLOD_TRY(make_grid(t, error));
    TETLOD_TRY(take_finest(t, error));
    return take_near(t, tets, error);
}

/* ---- what may be far off ---- */

/* Whether what the transition has in a cell may be further than the limits from what the corners have. */
static bool is_far_in(const struct transition *t, size_t cell, const uint32_t corners[4], const double *limits)
{
    uint32_t width = t->fields.width;
    for (uint32_t c = 0; c < width && t->grid.marked[cell]; c++) {
        const double *range = t->grid.ranges + 2 * (cell * width + c);
        double least = INFINITY, most = -INFINITY;
        for (int k = 0; k < 4; k++) {
            double value = t->finest.values[(size_t)width * corners[k] + c];
            least = smaller(least, value);
            most = larger(most, value);
        }
        if (larger(range[1] - least, most - range[0]) > limits[t->fields.of[c]])
            return true;
    }
    return false;
}

static bool may_be_far(const struct transition *t, const uint32_t corners[4], const double *limits)
{
    uint8_t cells[4][3];
    for (int c = 0; c < 4; c++)
        memcpy(cells[c], t->finest.cells[corners[c]], sizeof cells[c]);
    struct span span = span_of((const uint8_t(*)[3])cells);
    if (!touches(t, &span))
        return false;
    for (int x = span.from[0]; x <= span.to[0]; x++)
        for (int y = span.from[1]; y <= span.to[1]; y++)
            for (int z = span.from[2]; z <= span.to[2]; z++)
                if (is_far_in(t, grid_number(&t->grid, x, y, z), corners, limits))
                    return true;
    return false;
}

/* Numbers the part's vertices in the order in which they are met. */
static enum tetlod_status take_far(const struct transition *t, const double *limits, uint32_t *numbers,
                                   struct tetmesh *out, struct tetlod_error *error)
{
    size_t capacity = 0;
    memset(numbers, 0xff, t->finest.vertices * sizeof *numbers);
    for (size_t tet = 0; tet < t->finest.tets; tet++) {
        const uint32_t *corners = t->finest.corners + 4 * tet;
        if (!may_be_far(t, corners, limits))
            continue;
        TETLOD_TRY(room_reserve(t->room, (void **)&out->corners, &capacity, (size_t)out->tet_count + 1,
                                t->finest.tets, 4 * sizeof *out->corners, error));
        for (size_t c = 0; c < 4; c++) {
            uint32_t *number = &numbers[corners[c]];
            if (*number == TETLOD_NONE)
                *number = out->vertex_count++;
            out->corners[4 * (size_t)out->tet_count + c] = *number;
        }
        out->tet_count++;
    }
    return TETLOD_OK;
}

static enum tetlod_status take_vertices(const struct transition *t, const uint32_t *numbers, struct finest_part *out,
                                        struct tetlod_error *error)
{
    struct tetmesh *mesh = &out->mesh;
    TETLOD_TRY(room_take(t->room,
                         mesh->vertex_count * (uint64_t)((3 + t->fields.width) * sizeof(double) +
                                                         sizeof *out->bodies), error));
    mesh->position_type = t->region->position_type;
    mesh->positions = array_new(mesh->vertex_count, 3 * sizeof *mesh->positions);
    out->bodies = array_new(mesh->vertex_count, sizeof *out->bodies);
    if (!mesh->positions || !out->bodies)
        return tetlodi_fail_nomem(error, "a region's error", (uint64_t)mesh->vertex_count * 28);
    for (uint32_t i = 0; i < t->fields.count; i++) {
        const struct point_field *field = &t->region->fields[t->fields.fields[i]];
        TETLOD_TRY(tetmesh_add_field(mesh, field->name, field->components, field->type, error));
    }
    for (uint32_t v = 0; v < t->finest.vertices; v++) {
        uint32_t to = numbers[v];
        const double *row = t->finest.values + (size_t)t->fields.width * v;
        if (to == TETLOD_NONE)
            continue;
        memcpy(mesh->positions + 3 * (size_t)to, t->finest.positions + 3 * (size_t)v, 3 * sizeof *mesh->positions);
        out->bodies[to] = t->finest.bodies[v];
        for (uint32_t i = 0; i < mesh->field_count; row += mesh->fields[i++].components)
            memcpy(mesh->fields[i].values + (size_t)to * mesh->fields[i].components, row,
                   mesh->fields[i].components * sizeof *row);
    }
    return TETLOD_OK;
}

enum tetlod_status transition_far(const struct transition *t, const double *limits, struct finest_part *out,
                                  struct tetlod_error *error)
{
    const uint64_t numbering = t->finest.vertices * sizeof(uint32_t);
    *out = (struct finest_part){0};
    TETLOD_TRY(room_take(t->room, numbering, error));
    uint32_t *numbers = array_new(t->finest.vertices, sizeof *numbers);
    enum tetlod_status status = numbers ? take_far(t, limits, numbers, &out->mesh, error)
                                        : tetlodi_fail_nomem(error, "a region's error",
                                                             t->finest.vertices * (uint64_t)4);
    if (status == TETLOD_OK)
        status = take_vertices(t, numbers, out, error);
    free(numbers);
    room_back_to(t->room, room_held(t->room) - numbering);
    return status;
}
