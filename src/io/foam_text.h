/* SPDX-License-Identifier: BSD-3-Clause */
/* Lists and words of OpenFOAM files, text or binary. */
#ifndef TETLOD_FOAM_TEXT_H
#define TETLOD_FOAM_TEXT_H

#include "src/io/file_values.h"
#include "src/io/assemble.h"

struct foam_file {
    const char *name;  /* for messages */
    struct file_view view; /* owned */
    struct text rest;
    bool binary;
    enum value_type label, scalar; /* of binary lists */
    char class_name[48];
    struct tetlod_error *error;
};

/* Reads NAME, or NAME.gz, of the case's folder, and its header. */
TETLOD_CHECKED enum tetlod_status foam_open(struct foam_file *file, const struct io_input *input, const char *name,
                                            struct tetlod_error *error);
void foam_close(struct foam_file *file);

TETLOD_CHECKED enum tetlod_status foam_fail(const struct foam_file *file, const char *why);

/* The next word, number or single character ( ) { } ; without comments; empty at the end. */
struct text foam_token(struct foam_file *file);

/* The count in front of a list, held against the bytes that are left, and its opening bracket; *uniform: it is {value}. */
TETLOD_CHECKED enum tetlod_status foam_list(struct foam_file *file, enum value_type type, uint64_t width, uint64_t *count, bool *uniform);

/* Numbers of a list of which `width` make an element, in brackets of their own where they are text. The list's end is taken, too.
 * Labels that are no numbers of points, faces or cells become TETLOD_NONE. */
TETLOD_CHECKED enum tetlod_status foam_labels(struct foam_file *file, uint32_t **out, uint64_t *count);
TETLOD_CHECKED enum tetlod_status foam_scalars(struct foam_file *file, uint32_t width, double **out, uint64_t *count);

#endif
