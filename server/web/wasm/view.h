/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What the browser's worker holds of one stream: the bytes that have come, a cursor, and the mesh that is shown. That is the
 * cursor's own, or a copy on its way between two levels, while the cursor goes on. The functions are the module's exports;
 * server/web/client/tetlod.js calls them. Numbers are 32-bit words or doubles, arrays are addresses in the module's memory.
 */
#ifndef TETLOD_VIEW_H
#define TETLOD_VIEW_H

#include <stdbool.h>

#include "format/bytes.h"
#include "src/cut/cut.h"
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
    float *normal_room;
    size_t point_cap, value_cap, normal_cap;
};

struct view {
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;         /* at the cursor */
    struct tetmesh shown;            /* borrows its arrays */
    bool moving;                     /* from those below, not from the cursor */
    struct tetmesh from, to, between; /* a move: its ends, and where it is; the corners are `to`'s */
    double *shade, *function;        /* [vertex_count] the value that colours, the function whose zero set is cut */
    double *probed;                  /* a value for each component of each field */
    double centre[3];                /* that points are relative to */
    struct cut boundary;             /* of the mesh that is shown, if `has_boundary`; and its lines */
    bool has_boundary, has_lines;
    struct cut cut;
    struct view_part part;
    struct cut_grid grid;
    struct tetlodi_buffer text;
    struct tetlod_error error;
};

const struct tetlod_info *view_info(const struct view *view);

/* Another mesh is shown: room for its arrays, and nothing that was made of the last one holds. */
enum tetlod_status view_begin_pictures(struct view *view);

#endif
