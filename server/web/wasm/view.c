/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/web/wasm/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* wasm32 addresses 4 GiB, of which the pictures need a part. */
static const uint64_t MOST_BYTES = (uint64_t)3 << 30;

VIEW_EXPORT(view_allocate) void *view_allocate(uint32_t size);
VIEW_EXPORT(view_release) void view_release(void *block);
VIEW_EXPORT(view_new) struct view *view_new(void);
VIEW_EXPORT(view_add) uint32_t view_add(struct view *view, const void *bytes, uint32_t size);
VIEW_EXPORT(view_message) const char *view_message(const struct view *view);
VIEW_EXPORT(view_open) uint32_t view_open(struct view *view, const uint32_t *fields, uint32_t count);
VIEW_EXPORT(view_ready) uint32_t view_ready(const struct view *view);
VIEW_EXPORT(view_seek) uint32_t view_seek(struct view *view, uint32_t level);
VIEW_EXPORT(view_mesh) const struct tetlod_mesh *view_mesh(const struct view *view);
VIEW_EXPORT(view_centre) const double *view_centre(const struct view *view);
VIEW_EXPORT(view_move) uint32_t view_move(struct view *view, uint32_t level);
VIEW_EXPORT(view_place) void view_place(struct view *view, double t);

void *view_allocate(uint32_t size)
{
    return malloc(size ? size : 1);
}

void view_release(void *block)
{
    free(block);
}

/* One per module; it goes with the module's memory. */
struct view *view_new(void)
{
    const struct tetlod_options options = {sizeof options, MOST_BYTES};
    struct view *view = array_zero(1, sizeof *view);
    if (view && tetlod_feed_new(&view->feed, &options, &view->error) == TETLOD_OK)
        return view;
    free(view);
    return NULL;
}

const char *view_message(const struct view *view)
{
    return view->error.message;
}

uint32_t view_add(struct view *view, const void *bytes, uint32_t size)
{
    return tetlod_feed_add(view->feed, bytes, size, &view->error);
}

uint32_t view_ready(const struct view *view)
{
    return tetlod_feed_level(view->feed);
}

static const struct tetlod_info *info_of(const struct view *view)
{
    return tetlod_info(tetlod_feed_file(view->feed));
}

/* Points far from zero, next to their size, would not survive float32. */
static void choose_centre(struct view *view)
{
    const struct tetlod_info *info = info_of(view);
    double size = 0, reach = 0;
    for (int i = 0; i < 3; i++) {
        size = fmax(size, info->bounds[1][i] - info->bounds[0][i]);
        reach = fmax(reach, fmax(fabs(info->bounds[0][i]), fabs(info->bounds[1][i])));
    }
    for (int i = 0; i < 3; i++)
        view->centre[i] = reach > 64 * size ? (info->bounds[0][i] + info->bounds[1][i]) / 2 : 0;
}

/* The cursor's arrays are what is shown; nothing moves. */
static void rest(struct view *view)
{
    struct tetmesh *shown = &view->shown;
    shown->vertex_count = view->mesh.vertices;
    shown->tet_count = view->mesh.tets;
    shown->corners = (uint32_t *)(uintptr_t)view->mesh.corners;
    shown->positions = (double *)(uintptr_t)view->mesh.positions;
    for (uint32_t f = 0; f < shown->field_count; f++)
        shown->fields[f].values = (double *)(uintptr_t)view->mesh.fields[f];
}

static enum tetlod_status arrive(struct view *view)
{
    tetlod_cursor_mesh(view->cursor, &view->mesh);
    view_forget_pictures(view);
    rest(view);
    return view_reserve(view);
}

/* Names and components of the fields, without values. */
static enum tetlod_status add_fields(struct view *view, struct tetmesh *mesh)
{
    const struct tetlod_info *info = info_of(view);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        TETLOD_TRY(tetmesh_add_field(mesh, field->name, field->components, field->type, &view->error));
    }
    return TETLOD_OK;
}

uint32_t view_open(struct view *view, const uint32_t *fields, uint32_t count)
{
    struct tetlod_file *file = tetlod_feed_file(view->feed);
    TETLOD_TRY(tetlod_cursor_new(&view->cursor, file, count ? fields : NULL, count, &view->error));
    struct tetmesh *all[] = {&view->shown, &view->from, &view->moving};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        TETLOD_TRY(add_fields(view, all[i]));
    for (uint32_t f = 0; f < view->shown.field_count; f++)
        free(view->shown.fields[f].values);
    choose_centre(view);
    return arrive(view);
}

uint32_t view_seek(struct view *view, uint32_t level)
{
    enum tetlod_status status = tetlod_cursor_seek(view->cursor, level, &view->error);
    enum tetlod_status arrived = arrive(view);
    return status == TETLOD_OK ? arrived : status;
}

const struct tetlod_mesh *view_mesh(const struct view *view)
{
    return &view->mesh;
}

const double *view_centre(const struct view *view)
{
    return view->centre;
}

/* ---- between two levels ---- */

static bool resize(double **array, size_t count)
{
    double *moved = array_resize(*array, count, sizeof *moved);
    if (moved)
        *array = moved;
    return moved != NULL;
}

static enum tetlod_status resize_mesh(struct view *view, struct tetmesh *mesh)
{
    uint32_t vertices = view->mesh.vertices;
    bool made = resize(&mesh->positions, 3 * (size_t)vertices);
    for (uint32_t f = 0; made && f < mesh->field_count; f++)
        made = !view->mesh.fields[f] || resize(&mesh->fields[f].values, (size_t)vertices * mesh->fields[f].components);
    return made ? TETLOD_OK : tetlodi_fail_nomem(&view->error, "a move between two levels", 48 * (uint64_t)vertices);
}

/* Prepares a move between the cursor's level and a coarser one. */
uint32_t view_move(struct view *view, uint32_t level)
{
    TETLOD_TRY(resize_mesh(view, &view->from));
    TETLOD_TRY(resize_mesh(view, &view->moving));
    double **fields = array_zero(view->from.field_count, sizeof *fields);
    if (!fields)
        return tetlodi_fail_nomem(&view->error, "a move between two levels", 0);
    for (uint32_t f = 0; f < view->from.field_count; f++)
        fields[f] = view->mesh.fields[f] ? view->from.fields[f].values : NULL;
    enum tetlod_status status = tetlod_cursor_origins(view->cursor, level, view->from.positions, fields, &view->error);
    free(fields);
    return status;
}

static void blend(double *out, const double *from, const double *to, size_t count, double t)
{
    for (size_t i = 0; i < count; i++)
        out[i] = from[i] + t * (to[i] - from[i]);
}

/* Shows the mesh at t of the move: 0 has the coarser level's shape and values, 1 the cursor's own arrays. */
void view_place(struct view *view, double t)
{
    rest(view);
    if (t >= 1)
        return;
    size_t vertices = view->mesh.vertices;
    blend(view->moving.positions, view->from.positions, view->mesh.positions, 3 * vertices, t);
    view->shown.positions = view->moving.positions;
    for (uint32_t f = 0; f < view->shown.field_count; f++) {
        if (!view->mesh.fields[f])
            continue;
        blend(view->moving.fields[f].values, view->from.fields[f].values, view->mesh.fields[f],
              vertices * view->shown.fields[f].components, t);
        view->shown.fields[f].values = view->moving.fields[f].values;
    }
}
