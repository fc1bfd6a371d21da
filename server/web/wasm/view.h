/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What the browser's worker holds of one stream: the bytes that have come, a cursor, and the mesh that is shown. That
 * is the cursor's own, or a copy on its way between two levels, while the cursor goes on. server/web/client/tetlod.js
 * calls the exports: numbers are 32-bit words or doubles, arrays are addresses in the module's memory.
 */
#ifndef TETLOD_VIEW_H
#define TETLOD_VIEW_H

#include <stdbool.h>

#include "format/common/bytes.h"
#include "src/cut/cut.h"
#include "src/cut/cut_solid.h"
#include "src/cut/line.h"
#include "src/cut/rays.h"
#include "src/cut/resample.h"

#ifdef __wasm__
#define VIEW_EXPORT(name) __attribute__((export_name(#name)))
#else
#define VIEW_EXPORT(name)
#endif

/* A picture's part as the page draws it. Arrays stay valid until the next part is made. tetlod.js knows this layout. */
struct view_part {
    uint32_t point_count, triangle_count, line_count;
    float *points;             /* [3 * point_count], relative to the view's centre */
    float *values;             /* [point_count] */
    const uint32_t *triangles; /* [3 * triangle_count] */
    const uint32_t *lines;     /* [2 * line_count] */
    float *normals;            /* [3 * point_count], or NULL */
    /* of the vectors whose lengths the values are; 0: the values are linear on each triangle */
    uint32_t components;
    float *vectors;            /* [components * point_count] */
    float *normal_room;
    size_t point_cap, value_cap, normal_cap, vector_cap;
};

/* A part whose triangles each have corners of their own, of one value: that of the tetrahedron. */
struct view_facets {
    struct view_part part;
    uint32_t *triangles, *lines, *corners; /* corners: [vertex of the cut] one that lies there */
    size_t triangle_cap, line_cap, corner_cap;
};

/* Some of the values that colour. tetlod.js knows this layout. */
enum { SAMPLE_SIZE = 4096, SAMPLED_TETS = 1 << 18 };
struct view_sample {
    const float *values;
    uint32_t count; /* at most SAMPLE_SIZE */
    float room[SAMPLE_SIZE];
};

/* Tetrahedra whose four corners have values from low to high. */
struct view_range {
    bool of_cells; /* of a field of cells, that is loaded */
    uint32_t field;
    int32_t component;
    double low, high;
};

/* An array of the mesh: `count` numbers of every `stride`. */
struct view_array {
    const double *values;
    uint32_t stride, count;
};

/* What a surface is drawn of: places, and what colours. */
struct view_points {
    struct view_array places, shade;
    const struct point_field *field; /* colours show the length, or the function, of `shade`; NULL: its value */
};

/* The tetrahedra that an isosurface of a length may pass through, divided (fine.c). Begins zeroed; its memory is used
 * again. */
struct view_fine {
    struct tetmesh mesh, coarse; /* divided, and as they were before the last division; without fields */
    size_t position_cap, corner_cap[2], parent_cap[2], row_cap;
    uint32_t *parents[2];        /* [tet_count] of the mesh that is drawn, for each of the two */
    uint32_t width;              /* of a vertex's row: the vector, then what colours */
    double *rows;                /* [width * vertex_count] */
    double *lengths;             /* [vertex_count] of the vectors */
    struct pairs pairs;          /* working space: vertices of the mesh, and those between two */
    double accuracy;             /* that lengths, taken as linear, are to be too large by at most */
    double deviation;            /* and are: larger than that where too many tetrahedra would be needed */
};

/* Numbers of regions that are not drawn, ascending, of a field of cells. */
struct view_hidden {
    uint32_t field, count;
    double *numbers;
};

/* A mesh from elsewhere, which is shown in place of the cursor's until that moves: a level that is finer in boxes.
 * tetlod.js fills the arrays; of fields that are not decoded there is none. */
struct view_adopted {
    double *positions;   /* [3 * vertices] */
    uint32_t *corners;   /* [4 * tets] */
    uint32_t *numbers;   /* [tets] of the original */
    uint32_t *parts;     /* [tets] enum region_part of src/stream/region.h */
    double **fields;     /* [field][components * vertices] */
    uint32_t vertices, tets;
    bool is_shown;
};

/* A function of components of fields: steps over a stack. Its field has these components at each vertex of the mesh
 * that is shown. It counts as the field behind those of the stream. */
/* (a field has at most 64 components, too) */
enum { MAX_FUNCTION_INPUTS = 64, MAX_FUNCTION_STEPS = 256, MAX_FUNCTION_DEPTH = 64 };
struct view_input {
    uint32_t field, component;
};
struct view_step {
    uint32_t operation;
    double number;
};
struct view_function {
    struct point_field field;
    struct view_input inputs[MAX_FUNCTION_INPUTS];
    uint32_t step_count; /* 0: none is defined */
    struct view_step steps[MAX_FUNCTION_STEPS];
    size_t row_cap;
};

/* What is left of the mesh within planes, with places and values of its own. Begins zeroed. */
struct view_solid {
    struct cut_solid cut;
    double *positions;
    struct point_field *fields; /* [field_count] */
    size_t position_cap, *field_caps;
    bool is_used;
};

/* What is drawn, for other programs. tetlod.js knows this layout. */
struct view_collected {
    uint32_t vertices, tets;
    const double *positions;
    const uint32_t *corners, *numbers; /* numbers: of the original's tetrahedra */
    uint32_t *room;
    size_t room_cap;
};

struct view {
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;         /* at the cursor; at a step, with its values */
    struct tetlod_series *series;    /* NULL: none, or not opened yet */
    struct view_adopted adopted;
    uint32_t picked;                 /* of an adopted mesh, that pictures are of; TETLOD_NONE: all */
    const double **step_values;      /* [field] of the step that is shown, NULL: the level's own */
    double *step_points;             /* where points that move are then; NULL: at the level's own places */
    double span[2];
    uint32_t added[2], probed_part;
    struct tetmesh shown;            /* borrows its arrays */
    bool moving;                     /* from those below, not from the cursor */
    struct tetmesh from, to, between; /* a move: its ends, and where it is; the corners are `to`'s */
    double *shade, *function;        /* [vertex_count] the value that colours, the function whose zero set is cut */
    struct view_function defined;
    double *warped; /* points of the mesh, moved by `warp_scale` times a field of vectors; 0: none is */
    size_t warped_cap;
    uint32_t warp_field;
    double warp_scale;
    struct view_fine fine;           /* of the last isosurface of a length */
    double shade_range[2];
    /* [field of cells] values of all tetrahedra of the original, NULL: not loaded; all NULL: none is */
    double **cells;
    bool by_cells;                   /* tetrahedra have the values that colour, not vertices */
    double *of_tets, *of_kept;       /* those of the mesh that is shown, and of `kept` */
    struct view_sample sample;
    bool has_rows;                   /* the function colours, and its inputs are known */
    uint32_t shade_field;
    int32_t shade_component;
    double *probed;                  /* a value for each component of each field */
    double centre[3];                /* that points are relative to */
    struct cut boundary;             /* of the mesh that is shown, if `has_boundary`; and its lines */
    bool has_boundary, has_lines;
    bool has_range;                  /* pictures are of tetrahedra in a range only */
    struct view_range range;
    struct view_hidden hidden;       /* and not of these */
    bool has_box, cuts_plane;        /* and only within a box; and behind the clip plane */
    double box[6];
    struct view_solid solid;
    struct view_collected collected;
    bool has_kept;                   /* which are drawn is known, if not all are */
    struct tetmesh kept; /* those; borrows all but its corners; in a box it has vertices behind the mesh's */
    uint32_t *kept_tets;             /* [kept.tet_count] the mesh's that they are, or are of */
    bool clips;
    struct cut_plane clip;
    struct cut cut, trimmed;         /* a section or isosurface; what is behind the clip plane of it, if `clips` */
    double *distances;               /* [cut.vertex_count] from that plane */
    size_t distance_cap;
    struct view_part whole, part;
    struct view_facets facets;
    uint32_t *marks;                 /* edges of the triangles that are marked */
    size_t mark_cap;
    const struct view_part *drawn_part; /* one of these */
    struct cut_grid grid;
    uint32_t grid_size;              /* that it was made with, of the mesh and shade that are shown; 0: of others */
    struct cut_voxels voxels;
    struct cut_line line, pieces;    /* pieces: of one component */
    double *at_ends;                 /* working space: [components * ends] of the pieces */
    float *squares;                  /* working space: [points of the grid] */
    size_t at_end_cap, square_cap;
    struct cut_rays rays;            /* connected as what is drawn, if `has_rays` */
    bool has_rays;
    struct tetlodi_buffer text;
    struct tetlod_error error;
};

/* ---- exports. Those that can fail return an enum tetlod_status, which view_message explains ---- */

VIEW_EXPORT(view_allocate) void *view_allocate(uint32_t size);
VIEW_EXPORT(view_release) void view_release(void *block);

/* One per module; it goes with the module's memory. NULL: out of memory. */
VIEW_EXPORT(view_new) struct view *view_new(void);
VIEW_EXPORT(view_message) const char *view_message(const struct view *view);

/* Before them: they leave out all fields but these, `count` names that each end with NUL (tetlod_feed_select). */
VIEW_EXPORT(view_select) uint32_t view_select(struct view *view, const char *names, uint32_t count);
/* The next bytes of the stream; TETLOD_MORE until the index is there. */
VIEW_EXPORT(view_add) uint32_t view_add(struct view *view, const void *bytes, uint32_t size);
/* The index as JSON; NULL: out of memory. */
VIEW_EXPORT(view_describe) const char *view_describe(struct view *view);
/* The finest level that is there whole, or TETLOD_NONE. */
VIEW_EXPORT(view_ready) uint32_t view_ready(const struct view *view);

/* Decodes level 0, with these fields (count TETLOD_NONE: all); then moves to others. After a failure the cursor is at
 * the last level that could be decoded. */
VIEW_EXPORT(view_open) uint32_t view_open(struct view *view, const uint32_t *fields, uint32_t count);
VIEW_EXPORT(view_seek) uint32_t view_seek(struct view *view, uint32_t level);
VIEW_EXPORT(view_mesh) const struct tetlod_mesh *view_mesh(const struct view *view);
VIEW_EXPORT(view_centre) const double *view_centre(const struct view *view);

/* ---- steps in time (view_steps.c) ---- */

/* Bytes from elsewhere in the stream, until they are forgotten. */
VIEW_EXPORT(view_put) uint32_t view_put(struct view *view, double offset, const void *bytes, uint32_t size);
VIEW_EXPORT(view_forget) void view_forget(struct view *view);
/* Reads the table of steps, which is put; steps are of the fields that view_open named. Then the table as JSON; NULL:
 * out of memory. */
VIEW_EXPORT(view_series) uint32_t view_series(struct view *view, const uint32_t *fields, uint32_t count);
VIEW_EXPORT(view_describe_series) const char *view_describe_series(struct view *view);
/* Offset and size of the bytes that a step needs in a band, of the series' field number `field`. */
VIEW_EXPORT(view_span) const double *view_span(struct view *view, uint32_t field, uint32_t band, uint32_t step);
/* A bound of that field's error there, a fraction of its range. */
VIEW_EXPORT(view_step_error)
double view_step_error(const struct view *view, uint32_t field, uint32_t band, uint32_t step);
/* Moves the cursor to the band's level and shows a step, whose bytes are put. view_seek leaves the steps. */
VIEW_EXPORT(view_step) uint32_t view_step(struct view *view, uint32_t band, uint32_t step);
/* The same as a move from the step that is shown, of the same level: view_place. */
VIEW_EXPORT(view_step_move) uint32_t view_step_move(struct view *view, uint32_t band, uint32_t step);

/* Shows a copy of the cursor's mesh that can move from and to a coarser level's shape. If there is no room for it, the
 * cursor's own is shown. */
VIEW_EXPORT(view_move) uint32_t view_move(struct view *view, uint32_t level);
/* The same of a mesh from elsewhere (view_adopt.c): room for where its vertices come from, which is filled, places
 * (TETLOD_NONE) and values of fields that are decoded; then the move begins. */
VIEW_EXPORT(view_make_origins) uint32_t view_make_origins(struct view *view);
VIEW_EXPORT(view_origins) double *view_origins(const struct view *view, uint32_t field);
VIEW_EXPORT(view_move_adopted) void view_move_adopted(struct view *view);
/* Shows the mesh at t of the move: 0 has the coarser level's shape and values, 1 the finer one's. */
VIEW_EXPORT(view_place) void view_place(struct view *view, double t);
/* Shows the cursor's own mesh. */
VIEW_EXPORT(view_rest) uint32_t view_rest(struct view *view);

/* What a part has beside points, values and triangles. WITH_MARGIN is of an isosurface of a length, which curves within
 * tetrahedra: the surface then lies where the length is at least the value. */
enum { WITH_LINES = 1, WITH_NORMALS = 2, WITH_MARGIN = 4 };

/* The value that colours, of the mesh as it is now; component -1: the length of all of them, which pictures, grids and
 * lines take of interpolated components; field -1: nothing colours, the value is 0. Returns its least and greatest. */
VIEW_EXPORT(view_shade) const double *view_shade(struct view *view, uint32_t field, int32_t component);
/* From now on the field behind those of the stream is a function: `words` has two numbers for each input (field,
 * component) and two for each step (operation, number), as view_function.c reads them. */
VIEW_EXPORT(view_define) uint32_t view_define(struct view *view, const double *words, uint32_t inputs, uint32_t steps);
/* Some of those values, as many of each as it has of the volume. */
VIEW_EXPORT(view_sample) const struct view_sample *view_sample(struct view *view);
/* From now on the mesh's points are moved by so many times a field of three components that is decoded; 0: they are as
 * they were. */
VIEW_EXPORT(view_warp) uint32_t view_warp(struct view *view, uint32_t field, double scale);
/* From now on pictures are of what is behind a plane; or of everything again. */
VIEW_EXPORT(view_clip) void view_clip(struct view *view, double ox, double oy, double oz, double nx, double ny,
                                      double nz);
VIEW_EXPORT(view_unclip) void view_unclip(struct view *view);

/* ---- some of the tetrahedra (view_filter.c) ---- */

/* From now on pictures are of tetrahedra in a range, at the end of a move; or of all again. */
VIEW_EXPORT(view_threshold)
void view_threshold(struct view *view, bool of_cells, uint32_t field, int32_t component, double low, double high);
VIEW_EXPORT(view_unthreshold) void view_unthreshold(struct view *view);
/* And not of those with these numbers, ascending, in a field of cells that is loaded, of one component. */
VIEW_EXPORT(view_hide) uint32_t view_hide(struct view *view, uint32_t field, const double *numbers, uint32_t count);
/* And only of what is in a box, which is closed; or wherever it is. */
VIEW_EXPORT(view_box)
void view_box(struct view *view, bool has, double x0, double y0, double z0, double x1, double y1, double z1);
/* Finds those of the mesh that is shown: before pictures of it are made. */
VIEW_EXPORT(view_filter) uint32_t view_filter(struct view *view);

/* ---- what is in a box, and what is drawn as a mesh (view_solid.c) ---- */

/* What is drawn, also behind the clip plane, as tetrahedra: places and fields of its vertices (view_values) until the
 * next call; then view_filter anew. NULL: view_message says why. */
VIEW_EXPORT(view_collect) const struct view_collected *view_collect(struct view *view);

/* ---- a mesh from elsewhere (view_adopt.c) ---- */

/* What was added of the stream: its address and size. */
VIEW_EXPORT(view_added) const uint32_t *view_added(struct view *view);
/* Room for such a mesh, to be filled; NULL: no memory. It is shown by view_show_adopted, which refuses corners out of
 * range, and no longer after view_seek, view_step, or view_show_adopted(0). */
VIEW_EXPORT(view_adopt) const struct view_adopted *view_adopt(struct view *view, uint32_t vertices, uint32_t tets);
VIEW_EXPORT(view_show_adopted) uint32_t view_show_adopted(struct view *view, uint32_t shown);
/* From now on pictures are of one of its parts, or of all (TETLOD_NONE). */
VIEW_EXPORT(view_pick) void view_pick(struct view *view, uint32_t part);
/* Makes view_part of the boundary, whose lines are the edges of its triangles that are of tetrahedra of a part. */
VIEW_EXPORT(view_mark) uint32_t view_mark(struct view *view, uint32_t part);

/* ---- values of tetrahedra (view_cells.c) ---- */

/* Decodes a field of cells, or that of a step: its bytes, and those that view_cells_span says, are put. After a failure
 * it is NaN. */
VIEW_EXPORT(view_load_cells) uint32_t view_load_cells(struct view *view, uint32_t field, uint32_t step);
/* Offset and size. */
VIEW_EXPORT(view_cells_span) const double *view_cells_span(struct view *view, uint32_t field, uint32_t step);
/* [components * tetrahedra of the original]; NULL: it is not loaded. */
VIEW_EXPORT(view_cells) const double *view_cells(const struct view *view, uint32_t field);
/* Of a tetrahedron of the original, in a field of cells that is loaded. */
double view_cell_value(const struct view *view, uint32_t field, int32_t component, size_t tet);
/* As view_shade: such a field colours, which is loaded. After view_filter. Then its least and greatest value are in
 * view_shade_range. */
VIEW_EXPORT(view_shade_cells) uint32_t view_shade_cells(struct view *view, uint32_t field, int32_t component);
VIEW_EXPORT(view_shade_range) const double *view_shade_range(const struct view *view);

/* ---- pictures ---- */

/* Each makes view_part. */
VIEW_EXPORT(view_surface) uint32_t view_surface(struct view *view, uint32_t with);
VIEW_EXPORT(view_slice)
uint32_t view_slice(struct view *view, uint32_t with, double ox, double oy, double oz, double nx, double ny, double nz);
VIEW_EXPORT(view_isosurface)
uint32_t view_isosurface(struct view *view, uint32_t with, uint32_t field, int32_t component, double value);
/* Is the last isosurface as near as it is to be? One of a length is of flat triangles where it is curved; other ones
 * are exact. */
VIEW_EXPORT(view_is_near) bool view_is_near(const struct view *view);
VIEW_EXPORT(view_part) const struct view_part *view_part(const struct view *view);
/* The value that colours, or its logarithm, on a grid over the stream's bounds: view_grid and view_voxels. */
VIEW_EXPORT(view_resample) uint32_t view_resample(struct view *view, uint32_t size, uint32_t logarithmic);
VIEW_EXPORT(view_grid) const struct cut_grid *view_grid(const struct view *view);
VIEW_EXPORT(view_voxels) const struct cut_voxels *view_voxels(const struct view *view);
/* What rays through the tetrahedra need: view_ray_data. */
VIEW_EXPORT(view_rays) uint32_t view_rays(struct view *view);
VIEW_EXPORT(view_ray_data) const struct cut_rays *view_ray_data(const struct view *view);
/* A field of the mesh that is shown, its components vertex by vertex; NULL: it is not decoded. */
VIEW_EXPORT(view_values) const double *view_values(const struct view *view, uint32_t field);
/* The value that colours, along a segment through what is drawn: view_line. After view_filter. */
VIEW_EXPORT(view_along)
uint32_t view_along(struct view *view, double ax, double ay, double az, double bx, double by, double bz);
VIEW_EXPORT(view_line) const struct cut_line *view_line(const struct view *view);
/* Which tetrahedron of those that are drawn a point is in, or is as good as in: the page knows points of the surface in
 * float32 only. TETLOD_NONE, or its values are in view_probed: a number for each component of each field, NaN for those
 * that are not decoded. After view_filter. */
VIEW_EXPORT(view_probe) uint32_t view_probe(struct view *view, double x, double y, double z);
/* The part of an adopted mesh that it was in; else TETLOD_NONE. */
VIEW_EXPORT(view_probed_part) uint32_t view_probed_part(const struct view *view);
VIEW_EXPORT(view_probed) const double *view_probed(const struct view *view);

/* ---- within the module ---- */

const struct tetlod_info *view_info(const struct view *view);

/* One value per vertex: a component, or the length of all. A field that is not decoded counts as 0. */
void view_take_values(const struct view *view, const struct tetmesh *mesh, uint32_t vertices, uint32_t field,
                      int32_t component, double *out);

/* The function: of a row of its inputs; of the vertices of a mesh; its inputs at those of the mesh that is shown
 * (false: no memory). */
double view_evaluate(const struct view_function *function, const double *inputs);
void view_take_function(const struct view *view, const struct tetmesh *mesh, uint32_t vertices, double *out);
bool view_take_rows(struct view *view);
/* Of a row of a field that view_length_field gave: the function, or the length. */
double view_value_of(const struct view *view, const struct point_field *field, const double *row);

/* In place of the cursor's, if it is shown. */
void view_take_adopted(struct view *view);

/* The original's number of a tetrahedron that is shown. */
static inline uint32_t view_number(const struct view *view, uint32_t tet)
{
    return view->adopted.is_shown ? view->adopted.numbers[tet] : tet;
}

/* What pictures are of. */
const struct tetmesh *view_drawn(const struct view *view);

/* Places and values of the mesh that is shown have moved on. */
void view_follow_shown(struct view *view);

/* view_filter; `cuts_plane`: the tetrahedra are cut by the clip plane, too. */
enum tetlod_status view_filter_for(struct view *view, bool cuts_plane);

/* Cuts what is kept by the sides of the box, and the clip plane. */
enum tetlod_status view_cut_solid(struct view *view);

/* Lines of a cut of what is drawn: of those that only divide what the box cuts through none is left. `values`: as of
 * cut_lines. */
void view_drop_lines(const struct view *view, struct cut *cut, const double *values);

/* The values of its tetrahedra, if those colour, or NULL. */
const double *view_of_drawn(const struct view *view);

bool view_reserve_points(struct view_part *part, uint32_t count, bool normals);

/* The field whose length colours, or the function that colours; NULL: what colours is linear on each tetrahedron. */
const struct point_field *view_length_field(const struct view *view);

/* Values along a segment, and on a grid, by view->shade or the length of a field. (lengths.c) */
enum tetlod_status view_lengths_along(struct view *view, const double from[3], const double to[3]);
enum tetlod_status view_lengths_on_grid(struct view *view);

/* Divides what is drawn near where the length of a field is `value` into view->fine; `margin`: or larger by the
 * accuracy. (fine.c) */
enum tetlod_status view_divide(struct view *view, const struct point_field *field, double value, bool margin);

/* What is drawn of view->part, which was made of a cut. */
enum tetlod_status view_facet(struct view *view, const struct cut *cut);

/* The cursor has moved, or has other values. What is on its way between levels does not mind. */
enum tetlod_status view_arrive(struct view *view);

/* From now on the mesh has the level's own values and points. */
void view_leave_step(struct view *view);

/* Room for a move of the mesh at the cursor, and a copy of it without corners. */
enum tetlod_status view_make_room(struct view *view);
void view_copy(const struct view *view, struct tetmesh *out);

/* From now on the mesh that is shown is on its way from view->from to the cursor's. */
void view_start_move(struct view *view);

/* Another mesh is shown: room for its arrays, and nothing that was made of the last one holds. */
enum tetlod_status view_begin_pictures(struct view *view);

#endif
