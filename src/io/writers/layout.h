/* SPDX-License-Identifier: BSD-3-Clause */
/* How a writer describes a file that is written piece by piece: texts and arrays in their order. io.h has what its users call. */
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
    const double *values; /* ROW_VALUES: borrowed; NULL: the rows' owner gives them */
};

TETLOD_CHECKED enum tetlod_status layout_start(struct io_layout **out, struct tetlod_error *error);

/* What is written there becomes text behind what is there. */
struct tetlodi_sink layout_sink(struct io_layout *layout);

TETLOD_CHECKED enum tetlod_status layout_add(struct io_layout *layout, const struct layout_array *array, struct tetlod_error *error);

#endif
