/* SPDX-License-Identifier: BSD-3-Clause */
/* Lines and numbers of EnSight files: text, "C Binary" or "Fortran Binary", whose records have their size in front and
 * behind. */
#ifndef TETLOD_ENSIGHT_FILE_H
#define TETLOD_ENSIGHT_FILE_H

#include "src/io/services/assemble.h"
#include "src/io/services/file_values.h"

enum { ENSIGHT_LINE = 80 };
enum ensight_kind { ENSIGHT_TEXT, ENSIGHT_C, ENSIGHT_FORTRAN };

struct ensight_file {
    const char *name;     /* for messages */
    struct file_view view; /* owned */
    const char *begin;
    struct text rest;
    enum ensight_kind kind;
    bool big_endian;
    bool has_columns; /* of EnSight 6: numbers of text have fixed columns and may touch */
    struct tetlod_error *error;
};

/* Reads the file of that name beside the case; a geometry tells its kind in its first line, which is taken. To be
 * closed also after a failure. */
TETLOD_CHECKED enum tetlod_status ensight_open(struct ensight_file *file, const struct io_input *input,
                                               const char *name,
                                               bool is_geometry, struct tetlod_error *error);
void ensight_close(struct ensight_file *file);
TETLOD_CHECKED enum tetlod_status ensight_fail(const struct ensight_file *file, const char *why);

/* Goes to a step of a file that holds several; of others nothing is changed. */
TETLOD_CHECKED enum tetlod_status ensight_seek(struct ensight_file *file, uint64_t step);

/* The next line without the white space at its ends; false at the end of the file. */
bool ensight_line(struct ensight_file *file, char out[ENSIGHT_LINE + 1]);

/* Decides on the byte order of C Binary by the number of a part, which follows: it is a small one. */
void ensight_find_order(struct ensight_file *file);

/* Whether the file can hold so many numbers: to be asked before room is made for them. */
TETLOD_CHECKED enum tetlod_status ensight_fits(const struct ensight_file *file, uint64_t count);

/* The numbers of one record, or only past them if `out` is NULL. */
TETLOD_CHECKED enum tetlod_status ensight_ints(struct ensight_file *file, uint64_t count, int64_t *out);
/* Numbers of points that count from 1, as those from 0 on that cells have. */
TETLOD_CHECKED enum tetlod_status ensight_points(struct ensight_file *file, uint64_t count, uint32_t *out);
TETLOD_CHECKED enum tetlod_status ensight_floats(struct ensight_file *file, uint64_t count, double *out);

/* A number that counts things of at least one number each. */
TETLOD_CHECKED enum tetlod_status ensight_count(struct ensight_file *file, uint64_t *out);

#endif
