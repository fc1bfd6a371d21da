/* SPDX-License-Identifier: BSD-3-Clause */
/* The arrays of a legacy VTK file: text, or big-endian binary right after the line that announces them. */
#ifndef TETLOD_VTK_DATA_H
#define TETLOD_VTK_DATA_H

#include "format/tetlod.h"
#include "src/io/services/file_values.h"
#include "src/util/file.h"

enum vtk_kind { VTK_NUMBERS, VTK_BITS, VTK_STRINGS };

struct vtk_array_type {
    enum vtk_kind kind;
    enum value_type type; /* of numbers */
};

struct vtk_stream {
    const char *begin; /* of the file */
    struct text rest;
    bool binary;
    struct file_view *view; /* of the bytes, or NULL */
};

/* ERR_MESH at the place where the stream is: a line of text, a byte of a binary file. */
enum tetlod_status vtk_fail(const struct vtk_stream *stream, struct tetlod_error *error, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

TETLOD_CHECKED enum tetlod_status vtk_array_type(const struct vtk_stream *stream, struct text word,
                                                 struct vtk_array_type *out, struct tetlod_error *error);

/* The next count values; vtk_check_count is to be asked before room is made for them. */
TETLOD_CHECKED enum tetlod_status vtk_check_count(const struct vtk_stream *stream, enum value_type type, uint64_t count,
                                                  struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status vtk_doubles(struct vtk_stream *stream, enum value_type type, size_t count,
                                              double *out,
                                              struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status vtk_ints(struct vtk_stream *stream, enum value_type type, size_t count, int64_t *out,
                                           struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status vtk_skip(struct vtk_stream *stream, struct vtk_array_type type, uint64_t count,
                                           struct tetlod_error *error);

#endif
