/* SPDX-License-Identifier: BSD-3-Clause */
/* Lists and words of OpenFOAM files, text or binary. */
#ifndef TETLOD_FOAM_TEXT_H
#define TETLOD_FOAM_TEXT_H

#include "src/io/services/file_values.h"
#include "src/io/services/assemble.h"

struct gzip;

struct foam_file {
    const char *name;  /* for messages */
    struct file_view view; /* owned */
    struct gzip *gzip; /* owned: the part of the unpacked text that `rest` is in; NULL: the file is not packed */
    struct text rest;
    bool binary;
    enum value_type label, scalar; /* of binary lists */
    char class_name[48];
    struct tetlod_error *error;
};

/* Opens NAME, or NAME.gz, of the case's folder, and reads its header. To be closed also after a failure. */
TETLOD_CHECKED enum tetlod_status foam_open(struct foam_file *file, const struct io_input *input, const char *name,
                                            struct tetlod_error *error);
void foam_close(struct foam_file *file);

/* Says whether the rest of a packed file is sound, too. */
TETLOD_CHECKED enum tetlod_status foam_end(struct foam_file *file);

TETLOD_CHECKED enum tetlod_status foam_fail(const struct foam_file *file, const char *why);

/* The next word, number or single character ( ) { } ; without comments; empty at the end. It stays until the next
 * call. */
struct text foam_token(struct foam_file *file);

/* A list of labels, read one at a time. Those that are no numbers of points, faces or cells become TETLOD_NONE. */
struct foam_list {
    struct foam_file *file; /* borrowed */
    uint64_t count, taken;
    bool uniform;
    uint32_t value; /* the last one */
};

/* Reads the count in front of a list of labels, held against the bytes that are left, and its opening bracket. */
TETLOD_CHECKED enum tetlod_status foam_list_begin(struct foam_list *list, struct foam_file *file);

/* The same for a list whose elements are lists. */
TETLOD_CHECKED enum tetlod_status foam_list_of_lists(struct foam_list *list, struct foam_file *file);

/* Reads the next label, which is there, into list->value. */
TETLOD_CHECKED enum tetlod_status foam_list_next(struct foam_list *list);

/* Reads the bracket after the last label. */
TETLOD_CHECKED enum tetlod_status foam_list_end(struct foam_list *list);

/* A whole list of labels. */
TETLOD_CHECKED enum tetlod_status foam_labels(struct foam_file *file, uint32_t **out, uint64_t *count);

/* A whole list of which `width` numbers make an element, in brackets of their own where they are text. */
TETLOD_CHECKED enum tetlod_status foam_scalars(struct foam_file *file, uint32_t width, double **out, uint64_t *count);

#endif
