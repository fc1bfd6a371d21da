/* SPDX-License-Identifier: BSD-3-Clause */
/* What is drawn of the mesh that is shown: its boundary, slices, isosurfaces, a grid, with the value that colours
 * them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/web/wasm/view.h"
#include "src/util/array.h"

enum tetlod_status view_begin_pictures(struct view *view)
{
    uint32_t vertices = view->shown.vertex_count;
    double *shade = array_resize(view->shade, vertices, sizeof *shade);
    if (shade)
        view->shade = shade;
    double *function = array_resize(view->function, vertices, sizeof *function);
    if (function)
        view->function = function;
    view->has_boundary = view->has_lines = view->has_kept = view->has_rays = false;
    view->grid_size = 0;
    view->shade_field = TETLOD_NONE;
    view->by_cells = view->has_rows = false;
    if (!shade || !function)
        return tetlodi_fail_nomem(&view->error, "a picture", 16 * (uint64_t)vertices);
    for (uint32_t v = 0; v < vertices; v++)
        shade[v] = 0;
    return TETLOD_OK;
}

void view_take_values(const struct view *view, const struct tetmesh *mesh, uint32_t vertices, uint32_t field,
                      int32_t component, double *out)
{
    if (field == mesh->field_count) {
        view_take_function(view, mesh, vertices, out);
        return;
    }
    const struct point_field *of = field < mesh->field_count ? &mesh->fields[field] : NULL;
    for (uint32_t v = 0; v < vertices; v++) {
        const double *values = of && of->values ? of->values + (size_t)v * of->components : NULL;
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

const double *view_shade(struct view *view, uint32_t field, int32_t component)
{
    double low = INFINITY, high = -INFINITY;
    const struct tetmesh *drawn = view_drawn(view);
    view_take_values(view, drawn, drawn->vertex_count, field, component, view->shade);
    if (view->by_cells || field != view->shade_field || component != view->shade_component)
        view->grid_size = 0;
    view->by_cells = false;
    view->shade_field = field;
    view->shade_component = component;
    view->has_rows = field == view->shown.field_count && view_take_rows(view);
    for (uint32_t v = 0; v < view->shown.vertex_count; v++) {
        low = view->shade[v] < low ? view->shade[v] : low;
        high = view->shade[v] > high ? view->shade[v] : high;
    }
    view->shade_range[0] = low;
    view->shade_range[1] = high;
    return view->shade_range;
}

const struct point_field *view_length_field(const struct view *view)
{
    if (view->has_rows && !view->by_cells)
        return &view->defined.field;
    bool length = !view->by_cells && view->shade_component < 0 && view->shade_field < view->shown.field_count;
    const struct point_field *field = length ? &view_drawn(view)->fields[view->shade_field] : NULL;
    return field && field->values ? field : NULL;
}

/* The mesh that is drawn. */
static struct view_points drawn_points(const struct view *view)
{
    const struct point_field *field = view_length_field(view);
    struct view_array shade = {view->shade, 1, 1};
    if (field)
        shade = (struct view_array){field->values, field->components, field->components};
    return (struct view_points){{view_drawn(view)->positions, 3, 3}, shade, field};
}

static double volume_of(const struct view *view, const uint32_t *corners)
{
    double edges[3][3];
    const double *apex = view->shown.positions + 3 * (size_t)corners[3];
    for (int i = 0; i < 3; i++)
        for (int d = 0; d < 3; d++)
            edges[i][d] = view->shown.positions[3 * (size_t)corners[i] + d] - apex[d];
    return fabs(edges[0][0] * (edges[1][1] * edges[2][2] - edges[1][2] * edges[2][1]) -
                edges[0][1] * (edges[1][0] * edges[2][2] - edges[1][2] * edges[2][0]) +
                edges[0][2] * (edges[1][0] * edges[2][1] - edges[1][1] * edges[2][0])) / 6;
}

/* Tetrahedra in order, one value whenever another part of the whole volume is passed. Of millions, one in so
 * many: that is enough for some thousand values. */
const struct view_sample *view_sample(struct view *view)
{
    struct view_sample *sample = &view->sample;
    const uint32_t stride = 1 + view->shown.tet_count / SAMPLED_TETS;
    double whole = 0, passed = 0;
    for (uint32_t t = 0; t < view->shown.tet_count; t += stride)
        whole += volume_of(view, view->shown.corners + 4 * (size_t)t);
    sample->values = sample->room;
    sample->count = 0;
    for (uint32_t t = 0; t < view->shown.tet_count && sample->count < SAMPLE_SIZE; t += stride) {
        const uint32_t *corners = view->shown.corners + 4 * (size_t)t;
        passed += volume_of(view, corners);
        while (sample->count < SAMPLE_SIZE && passed > (sample->count + 0.5) / SAMPLE_SIZE * whole) {
            uint32_t corner = corners[sample->count & 3];
            sample->room[sample->count++] = (float)(view->by_cells ? view->of_tets[t] : view->shade[corner]);
        }
    }
    return sample;
}

static void take_distances(const struct view *view, double ox, double oy, double oz, double nx, double ny, double nz)
{
    const struct tetmesh *drawn = view_drawn(view);
    for (uint32_t v = 0; v < drawn->vertex_count; v++) {
        const double *p = drawn->positions + 3 * (size_t)v;
        view->function[v] = nx * (p[0] - ox) + ny * (p[1] - oy) + nz * (p[2] - oz);
    }
}

/* ---- parts ---- */

const struct view_part *view_part(const struct view *view)
{
    return view->drawn_part;
}

bool view_reserve_points(struct view_part *part, uint32_t count, bool normals)
{
    part->components = 0;
    return ARRAY_RESERVE(part->points, part->point_cap, 3 * (size_t)count) &&
           ARRAY_RESERVE(part->values, part->value_cap, count) &&
           (!normals || ARRAY_RESERVE(part->normal_room, part->normal_cap, 3 * (size_t)count));
}

static void take_counts(struct view_part *part, const struct cut *cut, uint32_t with)
{
    part->point_count = cut->vertex_count;
    part->triangle_count = cut->triangle_count;
    part->triangles = cut->triangles;
    part->line_count = with & WITH_LINES ? cut->line_count : 0;
    part->lines = cut->lines;
    part->normals = with & WITH_NORMALS ? part->normal_room : NULL;
}

static bool reserve(struct view_part *part, uint32_t count, bool normals, uint32_t components)
{
    if (!view_reserve_points(part, count, normals) ||
        !ARRAY_RESERVE(part->vectors, part->vector_cap, (size_t)count * components))
        return false;
    part->components = components;
    return true;
}

static enum tetlod_status draw(struct view *view, const struct cut *cut, uint32_t with, const struct view_points *of,
                               struct view_part *part)
{
    const struct view_array *places = &of->places, *shade = &of->shade;
    if (!reserve(part, cut->vertex_count, with & WITH_NORMALS, of->field ? shade->count : 0))
        return tetlodi_fail_nomem(&view->error, "a picture", 16 * (uint64_t)cut->vertex_count);
    for (uint32_t v = 0; v < cut->vertex_count; v++) {
        double row[MAX_FUNCTION_INPUTS];
        for (uint32_t i = 0; i < 3; i++)
            part->points[3 * (size_t)v + i] = (float)(cut_value(cut, v, places->values, places->stride,
                                                                i) - view->centre[i]);
        for (uint32_t c = 0; c < part->components; c++) {
            row[c] = cut_value(cut, v, shade->values, shade->stride, c);
            part->vectors[(size_t)v * part->components + c] = (float)row[c];
        }
        part->values[v] = (float)(of->field ? view_value_of(view, of->field, row)
                                            : cut_value(cut, v, shade->values, shade->stride, 0));
    }
    take_counts(part, cut, with);
    if (part->normals)
        cut_normals(cut, part->points, part->normals);
    return TETLOD_OK;
}

static enum tetlod_status draw_part(struct view *view, const struct cut *cut, uint32_t with,
                                    const struct view_points *of)
{
    TETLOD_TRY(draw(view, cut, with, of, &view->part));
    return view_facet(view, cut);
}

/* ---- what is behind a plane ---- */

void view_clip(struct view *view, double ox, double oy, double oz, double nx, double ny, double nz)
{
    view->clips = true;
    view->clip = (struct cut_plane){{ox, oy, oz}, {nx, ny, nz}};
}

void view_unclip(struct view *view)
{
    view->clips = false;
}

/* An array of the whole surface at the vertices of the trimmed one. */
static void blend_floats(const struct cut *trimmed, const float *from, uint32_t components, float *out)
{
    for (size_t v = 0; v < trimmed->vertex_count; v++) {
        const float *a = from + (size_t)trimmed->ends[2 * v] * components,
                    *b = from + (size_t)trimmed->ends[2 * v + 1] * components;
        for (uint32_t i = 0; i < components; i++)
            out[v * components + i] = a[i] + (float)trimmed->along[v] * (b[i] - a[i]);
    }
}

static void take_lengths(const struct view *view, struct view_part *part)
{
    double row[MAX_FUNCTION_INPUTS];
    for (size_t v = 0; v < part->point_count; v++) {
        for (uint32_t c = 0; c < part->components; c++)
            row[c] = (double)part->vectors[v * part->components + c];
        part->values[v] = (float)view_value_of(view, view_length_field(view), row);
    }
}

/* The view's part is what is behind the plane of `whole`, which was drawn of the view's cut. */
static enum tetlod_status trim(struct view *view, uint32_t with)
{
    const struct view_part *whole = &view->whole;
    const double *n = view->clip.normal, *o = view->clip.origin;
    struct view_part *part = &view->part;
    if (!ARRAY_RESERVE(view->distances, view->distance_cap, whole->point_count))
        return tetlodi_fail_nomem(&view->error, "a picture", 8 * (uint64_t)whole->point_count);
    for (size_t v = 0; v < whole->point_count; v++) {
        view->distances[v] = 0;
        for (size_t i = 0; i < 3; i++)
            view->distances[v] += n[i] * (whole->points[3 * v + i] + view->centre[i] - o[i]);
    }
    TETLOD_TRY(cut_trim(&view->cut, view->distances, &view->trimmed, &view->error));
    if (!reserve(part, view->trimmed.vertex_count, with & WITH_NORMALS, whole->components))
        return tetlodi_fail_nomem(&view->error, "a picture", 16 * (uint64_t)view->trimmed.vertex_count);
    take_counts(part, &view->trimmed, with);
    blend_floats(&view->trimmed, whole->points, 3, part->points);
    blend_floats(&view->trimmed, whole->values, 1, part->values);
    if (part->components) {
        blend_floats(&view->trimmed, whole->vectors, part->components, part->vectors);
        take_lengths(view, part);
    }
    if (part->normals)
        blend_floats(&view->trimmed, whole->normals, 3, part->normals);
    return TETLOD_OK;
}

/* ---- the boundary ---- */

static enum tetlod_status draw_lines(struct view *view, struct cut *cut, const double *values)
{
    TETLOD_TRY(cut_lines(cut, values, &view->error));
    view_drop_lines(view, cut, values);
    return TETLOD_OK;
}

/* What is drawn, at the end of a move: its triangles and lines are the same all the way. */
static struct tetmesh arrived(struct view *view)
{
    struct tetmesh mesh = *view_drawn(view);
    if (view->moving && !view->has_box)
        mesh.positions = view->to.positions;
    return mesh;
}

static enum tetlod_status find_boundary(struct view *view)
{
    if (view->has_boundary)
        return TETLOD_OK;
    struct tetmesh mesh = arrived(view);
    view->has_lines = false;
    TETLOD_TRY(cut_boundary(&mesh, &view->boundary, &view->error));
    view->has_boundary = true;
    return TETLOD_OK;
}

/* The boundary as far as it is behind the clip plane, closed by the section there. */
static enum tetlod_status clip_surface(struct view *view, uint32_t with)
{
    const double *o = view->clip.origin, *n = view->clip.normal;
    take_distances(view, o[0], o[1], o[2], n[0], n[1], n[2]);
    TETLOD_TRY(cut_clip(view_drawn(view), &view->boundary, view->function, &view->cut, &view->error));
    if (with & WITH_LINES)
        TETLOD_TRY(draw_lines(view, &view->cut, view->function));
    const struct view_points points = drawn_points(view);
    return draw_part(view, &view->cut, with, &points);
}

uint32_t view_surface(struct view *view, uint32_t with)
{
    TETLOD_TRY(find_boundary(view));
    if (view->clips)
        return clip_surface(view, with);
    if (with & WITH_LINES && !view->has_lines) {
        TETLOD_TRY(draw_lines(view, &view->boundary, NULL));
        view->has_lines = true;
    }
    const struct view_points points = drawn_points(view);
    return draw_part(view, &view->boundary, with, &points);
}

uint32_t view_mark(struct view *view, uint32_t part)
{
    TETLOD_TRY(view_surface(view, 0));
    const struct cut *cut = view->clips ? &view->cut : &view->boundary;
    if (!ARRAY_RESERVE(view->marks, view->mark_cap, 6 * (size_t)cut->triangle_count))
        return tetlodi_fail_nomem(&view->error, "a picture", 24 * (uint64_t)cut->triangle_count);
    uint32_t count = 0;
    for (size_t i = 0; view->adopted.is_shown && i < 3 * (size_t)cut->triangle_count; i++) {
        uint32_t tet = cut->tets[i / 3];
        if (view->adopted.parts[view->has_kept ? view->kept_tets[tet] : tet] != part)
            continue;
        view->marks[2 * (size_t)count] = cut->triangles[i];
        view->marks[2 * (size_t)count++ + 1] = cut->triangles[i % 3 == 2 ? i - 2 : i + 1];
    }
    view->part.lines = view->marks;
    view->part.line_count = count;
    view->drawn_part = &view->part;
    return TETLOD_OK;
}

/* ---- sections and isosurfaces ---- */

static enum tetlod_status finish_cut(struct view *view, uint32_t with, const struct view_points *of)
{
    if (with & WITH_LINES)
        TETLOD_TRY(draw_lines(view, &view->cut, view->function));
    else
        view->cut.line_count = 0;
    if (!view->clips)
        return draw_part(view, &view->cut, with, of);
    TETLOD_TRY(draw(view, &view->cut, with, of, &view->whole));
    TETLOD_TRY(trim(view, with));
    return view_facet(view, &view->trimmed);
}

uint32_t view_slice(struct view *view, uint32_t with, double ox, double oy, double oz, double nx, double ny, double nz)
{
    take_distances(view, ox, oy, oz, nx, ny, nz);
    TETLOD_TRY(cut_zero(view_drawn(view), view->function, &view->cut, &view->error));
    const struct view_points points = drawn_points(view);
    return finish_cut(view, with, &points);
}

/* The isosurface of a length, which is not linear on tetrahedra: of smaller ones. */
static enum tetlod_status cut_length(struct view *view, uint32_t with, const struct point_field *field, double value)
{
    struct view_fine *fine = &view->fine;
    struct view_points points = drawn_points(view);
    TETLOD_TRY(view_divide(view, field, value, with & WITH_MARGIN));
    points.places.values = fine->mesh.positions;
    points.shade = (struct view_array){fine->rows + field->components, fine->width, points.shade.count};
    for (uint32_t v = 0; v < fine->mesh.vertex_count; v++)
        fine->lengths[v] -= value + (with & WITH_MARGIN ? fine->accuracy : 0);
    TETLOD_TRY(cut_zero(&fine->mesh, fine->lengths, &view->cut, &view->error));
    for (uint32_t t = 0; t < view->cut.triangle_count; t++)
        view->cut.tets[t] = fine->parents[0][view->cut.tets[t]];
    return finish_cut(view, with & ~(uint32_t)WITH_LINES, &points);
}

uint32_t view_isosurface(struct view *view, uint32_t with, uint32_t field, int32_t component, double value)
{
    const struct tetmesh *drawn = view_drawn(view);
    const struct point_field *of = field < drawn->field_count ? &drawn->fields[field] : NULL;
    view->fine.deviation = view->fine.accuracy = 0;
    if (field == view->shown.field_count && view->has_rows)
        of = &view->defined.field;
    if (of && of->values && (component < 0 || of == &view->defined.field))
        return cut_length(view, with, of, value);
    view_take_values(view, drawn, drawn->vertex_count, field, component, view->function);
    for (uint32_t v = 0; v < drawn->vertex_count; v++)
        view->function[v] -= value;
    TETLOD_TRY(cut_zero(drawn, view->function, &view->cut, &view->error));
    const struct view_points points = drawn_points(view);
    return finish_cut(view, with, &points);
}

bool view_is_near(const struct view *view)
{
    return view->fine.deviation <= view->fine.accuracy;
}

/* ---- values at points ---- */

/* The stream's bounds; where points move, also what they reach. */
static void find_bounds(const struct view *view, double out[2][3])
{
    memcpy(out, view_info(view)->bounds, 2 * sizeof *out);
    const bool moved = view->step_points || view->warp_scale != 0;
    for (size_t i = 0; moved && i < 3 * (size_t)view->shown.vertex_count; i++) {
        out[0][i % 3] = fmin(out[0][i % 3], view->shown.positions[i]);
        out[1][i % 3] = fmax(out[1][i % 3], view->shown.positions[i]);
    }
}

uint32_t view_resample(struct view *view, uint32_t size, uint32_t logarithmic)
{
    double bounds[2][3];
    find_bounds(view, bounds);
    if (size != view->grid_size) { // a clip plane that is dragged needs no other grid
        view->grid_size = 0;
        cut_grid_cover(&view->grid, bounds[0], bounds[1], size);
        TETLOD_TRY(view_lengths_on_grid(view));
        view->grid_size = size;
    }
    return cut_make_voxels(&view->grid, logarithmic, view->clips ? &view->clip : NULL, &view->voxels, &view->error);
}

const struct cut_voxels *view_voxels(const struct view *view)
{
    return &view->voxels;
}

const struct cut_grid *view_grid(const struct view *view)
{
    return &view->grid;
}

uint32_t view_rays(struct view *view)
{
    if (!view->has_rays) {
        struct tetmesh mesh = arrived(view);
        TETLOD_TRY(cut_rays_connect(&mesh, &view->rays, &view->error));
        view->has_rays = true;
    }
    return cut_rays_place(view_drawn(view), view->shade, view_of_drawn(view), view->centre, &view->rays, &view->error);
}

const struct cut_rays *view_ray_data(const struct view *view)
{
    return &view->rays;
}

const double *view_values(const struct view *view, uint32_t field)
{
    return view_drawn(view)->fields[field].values;
}

uint32_t view_along(struct view *view, double ax, double ay, double az, double bx, double by, double bz)
{
    return view_lengths_along(view, (double[3]){ax, ay, az}, (double[3]){bx, by, bz});
}

const struct cut_line *view_line(const struct view *view)
{
    return &view->line;
}

uint32_t view_probe(struct view *view, double x, double y, double z)
{
    const struct tetlod_info *info = view_info(view);
    const double p[3] = {x, y, z};
    double weights[4], diagonal = 0, *out = view->probed;
    for (int i = 0; i < 3; i++)
        diagonal += (info->bounds[1][i] - info->bounds[0][i]) * (info->bounds[1][i] - info->bounds[0][i]);
    const struct tetmesh *drawn = view_drawn(view);
    uint32_t tet = cut_probe(drawn, p, 1e-4 * sqrt(diagonal), weights);
    for (uint32_t f = 0; tet != TETLOD_NONE && f < drawn->field_count; f++) {
        const struct point_field *field = &drawn->fields[f];
        for (uint32_t c = 0; c < field->components; c++, out++) {
            *out = field->values ? 0 : NAN;
            for (int i = 0; field->values && i < 4; i++)
                *out += weights[i] * field->values[(size_t)drawn->corners[4 * (size_t)tet + (size_t)i] *
                                                   field->components + c];
        }
    }
    view->probed_part = TETLOD_NONE;
    if (tet == TETLOD_NONE)
        return tet;
    tet = view->has_kept ? view->kept_tets[tet] : tet;
    if (view->adopted.is_shown)
        view->probed_part = view->adopted.parts[tet];
    return view_number(view, tet);
}

uint32_t view_probed_part(const struct view *view)
{
    return view->probed_part;
}

const double *view_probed(const struct view *view)
{
    return view->probed;
}
