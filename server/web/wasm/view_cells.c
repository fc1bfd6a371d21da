/* SPDX-License-Identifier: BSD-3-Clause */
/* Values of tetrahedra: colours by them. They lie behind the levels; those of a level's tetrahedra are the first. */
#include <math.h>
#include <stdlib.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

static enum tetlod_status read_cells(struct view *view, uint32_t field, uint32_t step)
{
    if (step == 0)
        return tetlod_cells(tetlod_feed_file(view->feed), field, view->cells[field], &view->error);
    if (tetlod_has_step_cells(view->series, field, step))
        return tetlod_step_cells(view->series, field, step, view->cells[field], &view->error);
    return tetlodi_fail(&view->error, TETLOD_ERR_ARGUMENT,
                        "the values of cells %.60s are known at the first step alone",
                        view_info(view)->cell_fields[field].name);
}

uint32_t view_load_cells(struct view *view, uint32_t field, uint32_t step)
{
    const struct tetlod_info *info = view_info(view);
    size_t count = (size_t)info->tets * info->cell_fields[field].components;
    if (!view->cells && !(view->cells = array_zero(info->cell_field_count, sizeof *view->cells)))
        return tetlodi_fail_nomem(&view->error, "values of tetrahedra", info->cell_field_count * sizeof *view->cells);
    if (!view->cells[field] && !(view->cells[field] = array_new(count, sizeof **view->cells)))
        return tetlodi_fail_nomem(&view->error, "values of tetrahedra", count * sizeof **view->cells);
    enum tetlod_status status = read_cells(view, field, step);
    for (size_t i = 0; i < count && status != TETLOD_OK; i++)
        view->cells[field][i] = NAN; // not those of another step
    view->grid_size = 0;
    return status;
}

const double *view_cells_span(struct view *view, uint32_t field, uint32_t step)
{
    struct tetlod_span span = {0, 0};
    if (step)
        span = tetlod_step_cells_span(view->series, field, step);
    view->span[0] = (double)span.offset;
    view->span[1] = (double)span.size;
    return view->span;
}

const double *view_cells(const struct view *view, uint32_t field)
{
    return view->cells ? view->cells[field] : NULL;
}

static double value_of(const double *values, uint32_t components, int32_t component)
{
    double sum = 0;
    if (component >= 0)
        return values[component];
    for (uint32_t c = 0; c < components; c++)
        sum += values[c] * values[c];
    return sqrt(sum);
}

double view_cell_value(const struct view *view, uint32_t field, int32_t component, size_t tet)
{
    uint32_t components = view_info(view)->cell_fields[field].components;
    return value_of(view->cells[field] + tet * components, components, component);
}

/* What is drawn may be some of the tetrahedra. */
static bool take_kept(struct view *view)
{
    if (!view->has_kept)
        return true;
    double *of_kept = array_resize(view->of_kept, view->kept.tet_count ? view->kept.tet_count : 1, sizeof *of_kept);
    if (!of_kept)
        return false;
    view->of_kept = of_kept;
    for (uint32_t t = 0; t < view->kept.tet_count; t++)
        of_kept[t] = view->of_tets[view->kept_tets[t]];
    return true;
}

uint32_t view_shade_cells(struct view *view, uint32_t field, int32_t component)
{
    uint32_t tets = view->shown.tet_count;
    double *of_tets = array_resize(view->of_tets, tets ? tets : 1, sizeof *of_tets), low = INFINITY, high = -INFINITY;
    if (of_tets)
        view->of_tets = of_tets;
    if (!view->by_cells || field != view->shade_field || component != view->shade_component)
        view->grid_size = 0;
    view->by_cells = of_tets != NULL;
    view->shade_field = field;
    view->shade_component = component;
    for (size_t t = 0; of_tets && t < tets; t++) {
        of_tets[t] = view_cell_value(view, field, component, view_number(view, (uint32_t)t));
        low = of_tets[t] < low ? of_tets[t] : low;
        high = of_tets[t] > high ? of_tets[t] : high;
    }
    view->shade_range[0] = low <= high ? low : 0;
    view->shade_range[1] = low <= high ? high : 0;
    view->by_cells = view->by_cells && take_kept(view);
    return view->by_cells ? TETLOD_OK : tetlodi_fail_nomem(&view->error, "values of tetrahedra", 8 * (uint64_t)tets);
}

const double *view_shade_range(const struct view *view)
{
    return view->shade_range;
}

const double *view_of_drawn(const struct view *view)
{
    return !view->by_cells ? NULL : view->has_kept ? view->of_kept : view->of_tets;
}

/* ---- parts whose triangles each have one value ---- */

static bool make_room(struct view *view, const struct cut *cut)
{
    struct view_facets *facets = &view->facets;
    size_t corners = 3 * (size_t)cut->triangle_count;
    return ARRAY_RESERVE(facets->triangles, facets->triangle_cap, corners) &&
           ARRAY_RESERVE(facets->lines, facets->line_cap, 2 * (size_t)view->part.line_count) &&
           ARRAY_RESERVE(facets->corners, facets->corner_cap, cut->vertex_count) &&
           view_reserve_points(&facets->part, (uint32_t)corners, view->part.normals != NULL);
}

/* Lines go between any corners of triangles that are at their ends. */
static uint32_t move_lines(const struct view_part *from, struct view_facets *facets)
{
    uint32_t count = 0;
    for (size_t l = 0; l < from->line_count; l++) {
        uint32_t a = facets->corners[from->lines[2 * l]], b = facets->corners[from->lines[2 * l + 1]];
        if (a == TETLOD_NONE || b == TETLOD_NONE)
            continue;
        facets->lines[2 * (size_t)count] = a;
        facets->lines[2 * (size_t)count++ + 1] = b;
    }
    return count;
}

enum tetlod_status view_facet(struct view *view, const struct cut *cut)
{
    const struct view_part *from = &view->part;
    struct view_facets *facets = &view->facets;
    struct view_part *part = &facets->part;
    const double *values = view_of_drawn(view);
    view->drawn_part = values ? part : from;
    if (!values)
        return TETLOD_OK;
    if (!make_room(view, cut))
        return tetlodi_fail_nomem(&view->error, "a picture", 48 * (uint64_t)cut->triangle_count);
    part->normals = from->normals ? part->normal_room : NULL;
    for (size_t v = 0; v < cut->vertex_count; v++)
        facets->corners[v] = TETLOD_NONE;
    for (size_t i = 0; i < 3 * (size_t)cut->triangle_count; i++) {
        size_t v = cut->triangles[i];
        facets->corners[v] = facets->triangles[i] = (uint32_t)i;
        part->values[i] = (float)values[cut->tets[i / 3]];
        for (size_t d = 0; d < 3; d++) {
            part->points[3 * i + d] = from->points[3 * v + d];
            if (part->normals)
                part->normals[3 * i + d] = from->normals[3 * v + d];
        }
    }
    part->point_count = 3 * cut->triangle_count;
    part->triangle_count = cut->triangle_count;
    part->triangles = facets->triangles;
    part->line_count = move_lines(from, facets);
    part->lines = facets->lines;
    return TETLOD_OK;
}
