/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/web/wasm/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* wasm32 addresses 4 GiB, of which the pictures need a part. */
static const uint64_t MAX_BYTES = (uint64_t)3 << 30;

void *view_allocate(uint32_t size)
{
    return malloc(size ? size : 1);
}

void view_release(void *block)
{
    free(block);
}

struct view *view_new(void)
{
    const struct tetlod_options options = {.struct_size = sizeof options, .max_bytes = MAX_BYTES};
    struct view *view = array_zero(1, sizeof *view);
    if (view)
        view->picked = TETLOD_NONE;
    if (view && tetlod_feed_new(&view->feed, &options, &view->error) == TETLOD_OK)
        return view;
    free(view);
    return NULL;
}

const char *view_message(const struct view *view)
{
    return view->error.message;
}

uint32_t view_select(struct view *view, const char *names, uint32_t count)
{
    const char **list = array_new(count, sizeof *list);
    if (!list)
        return tetlodi_fail_nomem(&view->error, "a selection of fields", count);
    for (uint32_t i = 0; i < count; i++, names += strlen(names) + 1)
        list[i] = names;
    enum tetlod_status status = tetlod_feed_select(view->feed, list, count, &view->error);
    free(list);
    return status;
}

uint32_t view_add(struct view *view, const void *bytes, uint32_t size)
{
    return tetlod_feed_add(view->feed, bytes, size, &view->error);
}

uint32_t view_ready(const struct view *view)
{
    return tetlod_feed_level(view->feed);
}

const struct tetlod_info *view_info(const struct view *view)
{
    return tetlod_info(tetlod_feed_file(view->feed));
}

/* Points far from zero, next to their size, would not survive float32. */
static void choose_centre(struct view *view)
{
    const struct tetlod_info *info = view_info(view);
    double size = 0, reach = 0;
    for (int i = 0; i < 3; i++) {
        size = fmax(size, info->bounds[1][i] - info->bounds[0][i]);
        reach = fmax(reach, fmax(fabs(info->bounds[0][i]), fabs(info->bounds[1][i])));
    }
    for (int i = 0; i < 3; i++)
        view->centre[i] = reach > 64 * size ? (info->bounds[0][i] + info->bounds[1][i]) / 2 : 0;
}

static void show(struct view *view, const double *positions, const uint32_t *corners)
{
    view->shown.positions = (double *)(uintptr_t)positions;
    view->shown.corners = (uint32_t *)(uintptr_t)corners;
}

uint32_t view_rest(struct view *view)
{
    view->moving = false;
    view->shown.vertex_count = view->mesh.vertices;
    view->shown.tet_count = view->mesh.tets;
    show(view, view->mesh.positions, view->mesh.corners);
    for (uint32_t f = 0; f < view->shown.field_count; f++)
        view->shown.fields[f].values = (double *)(uintptr_t)view->mesh.fields[f];
    return view_begin_pictures(view);
}

static void move_points(const struct view *view, const double *from, const double *vectors, size_t count, double *out)
{
    for (size_t i = 0; i < count; i++)
        out[i] = from[i] + view->warp_scale * vectors[i];
}

static enum tetlod_status warp_mesh(struct view *view)
{
    size_t count = 3 * (size_t)view->mesh.vertices;
    const double *vectors = view->warp_scale != 0 ? view->mesh.fields[view->warp_field] : NULL;
    if (!vectors)
        return TETLOD_OK;
    if (!ARRAY_RESERVE(view->warped, view->warped_cap, count + 1))
        return tetlodi_fail_nomem(&view->error, "the points", 8 * (uint64_t)count);
    move_points(view, view->mesh.positions, vectors, count, view->warped);
    view->mesh.positions = view->warped;
    return TETLOD_OK;
}

uint32_t view_warp(struct view *view, uint32_t field, double scale)
{
    if (scale != 0 && (field >= view->shown.field_count || view->shown.fields[field].components != 3))
        return tetlodi_fail(&view->error, TETLOD_ERR_ARGUMENT, "points are moved by a field of three components");
    view->warp_field = field;
    view->warp_scale = scale;
    view->moving = false;
    return view_arrive(view);
}

enum tetlod_status view_arrive(struct view *view)
{
    tetlod_cursor_mesh(view->cursor, &view->mesh);
    view_take_adopted(view);
    if (view->step_values)
        view->mesh.fields = view->step_values;
    if (view->step_points)
        view->mesh.positions = view->step_points;
    TETLOD_TRY(warp_mesh(view));
    return view->moving ? TETLOD_OK : view_rest(view);
}

/* Names and components of the fields, without values. */
static enum tetlod_status add_fields(struct view *view, struct tetmesh *mesh)
{
    const struct tetlod_info *info = view_info(view);
    for (uint32_t f = 0; f < info->field_count; f++) {
        const struct tetlod_field *field = &info->fields[f];
        TETLOD_TRY(tetmesh_add_field(mesh, field->name, field->components, field->type, &view->error));
    }
    return TETLOD_OK;
}

uint32_t view_open(struct view *view, const uint32_t *fields, uint32_t count)
{
    struct tetlod_file *file = tetlod_feed_file(view->feed);
    TETLOD_TRY(tetlod_cursor_new(&view->cursor, file, count != TETLOD_NONE ? fields : NULL, count, &view->error));
    struct tetmesh *all[] = {&view->shown, &view->from, &view->to, &view->between};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        TETLOD_TRY(add_fields(view, all[i]));
    size_t components = 0;
    for (uint32_t f = 0; f < view->shown.field_count; f++) {
        free(view->shown.fields[f].values);
        components += view->shown.fields[f].components;
    }
    view->probed = array_zero(components, sizeof *view->probed);
    if (!view->probed)
        return tetlodi_fail_nomem(&view->error, "the fields", 8 * (uint64_t)components);
    choose_centre(view);
    return view_arrive(view);
}

uint32_t view_seek(struct view *view, uint32_t level)
{
    view_leave_step(view);
    enum tetlod_status status = tetlod_cursor_seek(view->cursor, level, &view->error);
    enum tetlod_status arrived = view_arrive(view);
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

static bool resize_mesh(const struct view *view, struct tetmesh *mesh)
{
    uint32_t vertices = view->mesh.vertices;
    bool made = resize(&mesh->positions, 3 * (size_t)vertices);
    for (uint32_t f = 0; made && f < mesh->field_count; f++)
        made = !view->mesh.fields[f] || resize(&mesh->fields[f].values, (size_t)vertices * mesh->fields[f].components);
    return made;
}

enum tetlod_status view_make_room(struct view *view)
{
    uint32_t *corners = array_resize(view->to.corners, view->mesh.tets, 4 * sizeof *corners);
    if (corners)
        view->to.corners = corners;
    if (corners && resize_mesh(view, &view->from) && resize_mesh(view, &view->to) && resize_mesh(view, &view->between))
        return TETLOD_OK;
    return tetlodi_fail_nomem(&view->error, "a move", 96 * (uint64_t)view->mesh.vertices);
}

void view_copy(const struct view *view, struct tetmesh *out)
{
    const struct tetlod_mesh *mesh = &view->mesh;
    out->vertex_count = mesh->vertices;
    out->tet_count = mesh->tets;
    memcpy(out->positions, mesh->positions, 24 * (size_t)mesh->vertices);
    for (uint32_t f = 0; f < out->field_count; f++)
        if (mesh->fields[f])
            memcpy(out->fields[f].values, mesh->fields[f], 8 * (size_t)mesh->vertices * out->fields[f].components);
}

static void warp_origins(struct view *view)
{
    const double *vectors = view->warp_scale != 0 ? view->from.fields[view->warp_field].values : NULL;
    if (vectors && view->mesh.fields[view->warp_field])
        move_points(view, view->from.positions, vectors, 3 * (size_t)view->mesh.vertices, view->from.positions);
}

static enum tetlod_status find_origins(struct view *view, uint32_t level)
{
    double **fields = array_zero(view->from.field_count, sizeof *fields);
    if (!fields)
        return tetlodi_fail_nomem(&view->error, "a move between two levels", 8 * (uint64_t)view->from.field_count);
    for (uint32_t f = 0; f < view->from.field_count; f++)
        fields[f] = view->mesh.fields[f] ? view->from.fields[f].values : NULL;
    enum tetlod_status status = tetlod_cursor_origins(view->cursor, level, view->from.positions, fields, &view->error);
    free(fields);
    if (status == TETLOD_OK)
        warp_origins(view);
    return status;
}

void view_start_move(struct view *view)
{
    view_copy(view, &view->to);
    memcpy(view->to.corners, view->mesh.corners, 16 * (size_t)view->mesh.tets);
    view->moving = true;
    view_place(view, 1);
}

uint32_t view_move(struct view *view, uint32_t level)
{
    TETLOD_TRY(view_rest(view));
    TETLOD_TRY(view_make_room(view));
    TETLOD_TRY(find_origins(view, level));
    view_start_move(view);
    return TETLOD_OK;
}

uint32_t view_make_origins(struct view *view)
{
    TETLOD_TRY(view_rest(view));
    return view_make_room(view);
}

double *view_origins(const struct view *view, uint32_t field)
{
    return field == TETLOD_NONE ? view->from.positions : view->from.fields[field].values;
}

void view_move_adopted(struct view *view)
{
    warp_origins(view);
    view_start_move(view);
}

static void blend(double *out, const double *from, const double *to, size_t count, double t)
{
    for (size_t i = 0; i < count; i++)
        out[i] = from[i] + t * (to[i] - from[i]);
}

void view_place(struct view *view, double t)
{
    if (!view->moving)
        return;
    bool arrived = t >= 1;
    view->grid_size = 0;
    const struct tetmesh *to = &view->to, *at = arrived ? to : &view->between;
    size_t vertices = view->shown.vertex_count;
    show(view, at->positions, to->corners);
    view_follow_shown(view);
    if (!arrived)
        blend(at->positions, view->from.positions, to->positions, 3 * vertices, t);
    for (uint32_t f = 0; f < to->field_count; f++) {
        if (!view->shown.fields[f].values)
            continue;
        view->shown.fields[f].values = at->fields[f].values;
        if (!arrived)
            blend(at->fields[f].values, view->from.fields[f].values, to->fields[f].values,
                  vertices * to->fields[f].components, t);
    }
}
