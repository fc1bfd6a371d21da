/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What the browser's worker holds of one stream: the bytes that have come, a cursor, and the mesh on its way between two
 * levels. The functions are the module's exports; server/web/client/tetlod.js calls them. Numbers are 32-bit words or
 * doubles, arrays are addresses in the module's memory.
 */
#ifndef TETLOD_VIEW_H
#define TETLOD_VIEW_H

#include <stdbool.h>

#include "format/bytes.h"
#include "src/cut/cut.h"

#ifdef __wasm__
#define VIEW_EXPORT(name) __attribute__((export_name(#name)))
#else
#define VIEW_EXPORT(name)
#endif

/* A picture's part as the page draws it. Arrays stay valid until the next part is made. tetlod.js knows this layout. */
struct view_part {
    uint32_t point_count, triangle_count;
    float *points;       /* [3 * point_count], relative to the view's centre */
    float *values;       /* [point_count] */
    uint32_t *triangles; /* [3 * triangle_count] */
    size_t point_cap, value_cap;
};

struct view {
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;     /* at the cursor */
    struct tetmesh shown;        /* the mesh on its way; its corners, and at rest all its arrays, are the cursor's */
    struct tetmesh from, moving; /* arrays of a move: where it comes from, where it is */
    double *shade, *function;    /* [vertex_count] the value that colours, the function whose zero set is cut */
    double centre[3];            /* that points are relative to */
    struct cut boundary;         /* of the cursor's level, if `has_boundary` */
    bool has_boundary;
    struct cut cut;
    struct view_part part;
    struct tetlodi_buffer text;
    struct tetlod_error error;
};

/* Makes room for the arrays of a level. */
enum tetlod_status view_reserve(struct view *view);
/* The level has changed: nothing that was made of the last one holds. */
void view_forget_pictures(struct view *view);
void view_free_pictures(struct view *view);

#endif
