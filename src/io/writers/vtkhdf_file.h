/* SPDX-License-Identifier: BSD-3-Clause */
/* A VTKHDF file in memory, as HDF5 wants to go back and forth in it. What goes wrong makes `good` false, for good. */
#ifndef TETLOD_VTKHDF_FILE_H
#define TETLOD_VTKHDF_FILE_H

#include "src/io/services/h5.h"

struct vtkhdf_file {
    hid_t file, root; /* root: the group VTKHDF */
    size_t user_block;
    bool good;
};

/* `user_block`: bytes before the HDF5 file itself, 0 or a power of two from 512 on. */
bool vtkhdf_create(struct vtkhdf_file *out, hsize_t user_block);
void vtkhdf_begin(struct vtkhdf_file *w); /* makes the group */

/* The file's bytes so far, until more is put; NULL: memory is short. */
unsigned char *vtkhdf_image(struct vtkhdf_file *w, size_t *size);
void vtkhdf_close(struct vtkhdf_file *w);

/* Data of `memory` type as `stored` type, row by row in compressed chunks; `name` is a path below the root. */
void vtkhdf_put_set(struct vtkhdf_file *w, const char *name, int rank, const hsize_t *dims, hid_t memory, hid_t stored,
                    const void *data);
/* The same of a set whose rows may become more. */
void vtkhdf_put_growing(struct vtkhdf_file *w, const char *name, int rank, const hsize_t *dims, hid_t memory,
                        hid_t stored, const void *data);
void vtkhdf_put_attributes(struct vtkhdf_file *w, int64_t major);
void vtkhdf_put_unit(struct vtkhdf_file *w, const char *path, const char *unit);
hid_t vtkhdf_float_type(enum tetlod_type type);

/* The path of a data set in a group, to be freed; NULL: no memory. A '/' in a field's name would be a group. */
char *vtkhdf_path(const char *group, const char *name);

/* All of a file that has no steps. */
TETLOD_CHECKED enum tetlod_status vtkhdf_put_mesh(struct vtkhdf_file *w, const struct tetmesh *mesh,
                                                  struct tetlod_error *error);

#endif
