/* SPDX-License-Identifier: BSD-3-Clause */
/* What is drawn of the mesh that is shown: its boundary, slices, isosurfaces, with the value that colours them. */
#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

VIEW_EXPORT(view_shade) void view_shade(struct view *view, uint32_t field, int32_t component);
VIEW_EXPORT(view_part) const struct view_part *view_part(const struct view *view);
VIEW_EXPORT(view_surface) uint32_t view_surface(struct view *view);
VIEW_EXPORT(view_slice) uint32_t view_slice(struct view *view, double ox, double oy, double oz, double nx, double ny, double nz);
VIEW_EXPORT(view_isosurface) uint32_t view_isosurface(struct view *view, uint32_t field, int32_t component, double value);

void view_forget_pictures(struct view *view)
{
    cut_fini(&view->boundary);
    view->has_boundary = false;
}

enum tetlod_status view_reserve(struct view *view)
{
    uint32_t vertices = view->mesh.vertices;
    double *shade = array_resize(view->shade, vertices, sizeof *shade);
    if (shade)
        view->shade = shade;
    double *function = array_resize(view->function, vertices, sizeof *function);
    if (function)
        view->function = function;
    if (!shade || !function)
        return tetlodi_fail_nomem(&view->error, "a picture", 16 * (uint64_t)vertices);
    for (uint32_t v = 0; v < vertices; v++)
        shade[v] = 0;
    return TETLOD_OK;
}

/* One value per vertex: a component, or the length of all. A field that is not decoded counts as 0. */
static void take_values(const struct view *view, uint32_t field, int32_t component, double *out)
{
    const struct point_field *of = &view->shown.fields[field];
    for (uint32_t v = 0; v < view->shown.vertex_count; v++) {
        const double *values = of->values ? of->values + (size_t)v * of->components : NULL;
        double sum = 0;
        if (values && component >= 0)
            out[v] = values[component];
        else {
            for (uint32_t c = 0; values && c < of->components; c++)
                sum += values[c] * values[c];
            out[v] = sqrt(sum);
        }
    }
}

void view_shade(struct view *view, uint32_t field, int32_t component)
{
    take_values(view, field, component, view->shade);
}

const struct view_part *view_part(const struct view *view)
{
    return &view->part;
}

static enum tetlod_status draw(struct view *view, const struct cut *cut)
{
    struct view_part *part = &view->part;
    part->point_count = part->triangle_count = 0;
    if (!array_reserve((void **)&part->points, &part->point_cap, 3 * (size_t)cut->vertex_count, sizeof *part->points) ||
        !array_reserve((void **)&part->values, &part->value_cap, cut->vertex_count, sizeof *part->values))
        return tetlodi_fail_nomem(&view->error, "a picture", 16 * (uint64_t)cut->vertex_count);
    for (uint32_t v = 0; v < cut->vertex_count; v++) {
        for (uint32_t i = 0; i < 3; i++)
            part->points[3 * (size_t)v + i] = (float)(cut_value(cut, v, view->shown.positions, 3, i) - view->centre[i]);
        part->values[v] = (float)cut_value(cut, v, view->shade, 1, 0);
    }
    part->point_count = cut->vertex_count;
    part->triangle_count = cut->triangle_count;
    part->triangles = cut->triangles;
    return TETLOD_OK;
}

/* The triangles are the same all the way of a move. */
uint32_t view_surface(struct view *view)
{
    if (!view->has_boundary) {
        struct tetmesh mesh = view->shown;
        mesh.positions = (double *)(uintptr_t)view->mesh.positions;
        TETLOD_TRY(cut_boundary(&mesh, &view->boundary, &view->error));
        view->has_boundary = true;
    }
    return draw(view, &view->boundary);
}

static enum tetlod_status draw_zero(struct view *view)
{
    cut_fini(&view->cut);
    TETLOD_TRY(cut_zero(&view->shown, view->function, &view->cut, &view->error));
    return draw(view, &view->cut);
}

uint32_t view_slice(struct view *view, double ox, double oy, double oz, double nx, double ny, double nz)
{
    for (uint32_t v = 0; v < view->shown.vertex_count; v++) {
        const double *p = view->shown.positions + 3 * (size_t)v;
        view->function[v] = nx * (p[0] - ox) + ny * (p[1] - oy) + nz * (p[2] - oz);
    }
    return draw_zero(view);
}

uint32_t view_isosurface(struct view *view, uint32_t field, int32_t component, double value)
{
    take_values(view, field, component, view->function);
    for (uint32_t v = 0; v < view->shown.vertex_count; v++)
        view->function[v] -= value;
    return draw_zero(view);
}
