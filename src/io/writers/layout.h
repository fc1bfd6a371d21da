/* SPDX-License-Identifier: BSD-3-Clause */
/* How a writer describes a file that is written piece by piece: texts and arrays in their order. io.h has what its
 * users call. */
#ifndef TETLOD_LAYOUT_H
#define TETLOD_LAYOUT_H

#include "src/io/writers/writers.h"

/* What the rows of an array hold. */
enum row_kind {
    ROW_VALUES,        /* a column's components of a point */
    ROW_CORNERS,       /* the corners of a tetrahedron */
    ROW_COUNT_CORNERS, /* their number, 4, and the corners */
    ROW_END,           /* 4, 8, 12, ... */
    ROW_TYPE,          /* VTK's number of a tetrahedron */
};

struct layout_array {
    enum row_kind kind;
    uint32_t column; /* ROW_VALUES: 0 the position, 1 + f field f */
    uint32_t words;  /* of a row */
    size_t width;    /* bytes of a word */
    bool big_endian, integer; /* integer: the values are written as integers */
    uint64_t rows;
    const double *values;    /* ROW_VALUES: borrowed; NULL: the rows' owner gives them */
    const uint32_t *corners; /* ROW_CORNERS, ROW_COUNT_CORNERS: the same */
};

/* The array of a field, or of positions: integers stay integers where their values, which then must be there, allow
 * it. */
struct layout_array layout_of_field(const struct point_field *field, uint32_t column, uint64_t rows);

TETLOD_CHECKED enum tetlod_status layout_start(struct io_layout **out, struct tetlod_error *error);

/* What is written there becomes text behind what is there. */
struct tetlodi_sink layout_sink(struct io_layout *layout);

TETLOD_CHECKED enum tetlod_status layout_add(struct io_layout *layout, const struct layout_array *array,
                                             struct tetlod_error *error);

/* The words first .. first + count of an array that borrows what it holds; `first` begins a row of ROW_COUNT_CORNERS.
 * Any thread may call it. */
void layout_store(const struct layout_array *array, uint64_t first, size_t count, unsigned char *out);

/* Ends the laying out: a layout that failed is freed, and *out becomes NULL. Returns `status`. */
enum tetlod_status layout_end(struct io_layout **out, enum tetlod_status status);

/* Writes the whole file of a mesh that is in memory. */
typedef enum tetlod_status io_layout_maker(struct io_layout **out, const struct tetmesh *shape,
                                           struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status layout_write_whole(io_layout_maker *lay_out, const struct tetmesh *mesh,
                                                     const struct tetlodi_sink *sink, struct tetlod_error *error);

#endif
