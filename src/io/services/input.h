/* SPDX-License-Identifier: BSD-3-Clause */
/* What a reader gets: the bytes of a file, and the way to other files that this one names. */
#ifndef TETLOD_IO_INPUT_H
#define TETLOD_IO_INPUT_H

#include "src/io/services/report.h"
#include "src/util/file.h"

struct blocks;
struct io_input;

/* A reader turns a file into blocks (assemble.h), which its caller frees, also after a failure. */
typedef enum tetlod_status io_reader(struct blocks *out, const struct io_input *input, struct io_report *report,
                                     struct tetlod_error *error);

/* A file and, for formats of two files, the other one (else NULL). The views are those of bytes that are not in memory;
 * NULL: they are. */
struct io_input {
    const unsigned char *bytes;
    size_t size;
    struct file_view *view, *other_view;
    const struct file_input *file; /* for readers that read large ranges by several threads; or NULL */
    const unsigned char *other;
    size_t other_size;
    const char *other_path;
    const char *path; /* of the file, for formats that name further files; NULL: there are none */
    const struct io_read_options *options; /* NULL: the defaults */
    uint32_t part; /* which one, from 1, of the pieces that a file holds, each of an OpenFOAM case; 0: all, or one */
    uint32_t ranges; /* > 1: the part is one of so many ranges of the only piece */
    unsigned depth; /* how many files have named one another on the way to this one */
    io_reader *read_any; /* of a file of any format that this one names; io_read sets it */
};

/* A file that is open as an input. */
struct opened_input {
    struct file_input file;
    struct file_view view;
};

/* Opens a file and fills the input's bytes. To be closed also after a failure. */
TETLOD_CHECKED enum tetlod_status io_input_open(struct opened_input *opened, struct io_input *input, const char *path,
                                                struct tetlod_error *error);
void io_input_close(struct opened_input *opened);

/* For readers of files that name others: reads the file `name` beside `from`, whatever its format. Outside the folder
 * only with the option `follow`. */
TETLOD_CHECKED enum tetlod_status io_read_named(struct blocks *out, const struct io_input *from, const char *name,
                                                struct io_report *report, struct tetlod_error *error);

/* The path of such a file; the caller frees it. */
TETLOD_CHECKED enum tetlod_status io_resolve(const struct io_input *from, const char *name, char **out,
                                             struct tetlod_error *error);

/* Whether the word stands somewhere in the bytes. */
bool sniff_holds(const unsigned char *bytes, size_t size, const char *word);

#endif
