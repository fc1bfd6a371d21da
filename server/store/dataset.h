/* SPDX-License-Identifier: BSD-3-Clause */
/* An open stream: immutable and counted. It is found by id in the catalogue's table; an id never becomes part of a path. */
#ifndef TETLOD_SERVER_DATASET_H
#define TETLOD_SERVER_DATASET_H

#include <stdbool.h>
#include <time.h>

#include "format/tetlod.h"

enum { ID_CAPACITY = 129 }; // 128 bytes and the NUL

/* Tells whether a file is still what was opened. */
struct file_identity {
    uint64_t device, inode, size, links;
    struct timespec written, changed; /* the first can be set at will, the second not */
};

struct dataset;

/* Takes over `fd`, also on failure. The id is copied. */
TETLOD_CHECKED enum tetlod_status dataset_open(struct dataset **out, const char *id, int fd, struct tetlod_error *error);

struct dataset *dataset_hold(struct dataset *dataset);
void dataset_release(struct dataset *dataset);

const char *dataset_id(const struct dataset *dataset);
const struct tetlod_info *dataset_info(const struct dataset *dataset);
/* "max=0.01, sampled=0.008": the measures of a level that are known, each the largest over the controlled fields. */
const char *dataset_level_errors(const struct dataset *dataset, uint32_t level);

int dataset_fd(const struct dataset *dataset);

struct tetlod_file *dataset_file(struct dataset *dataset);

/* Reads all and holds it against its digests. */
TETLOD_CHECKED enum tetlod_status dataset_check(struct dataset *dataset, struct tetlod_error *error);

/* False once the bytes were written over in place: then nothing of it may be sent any more. */
bool dataset_intact(const struct dataset *dataset);

/* False if it is not a regular file, or cannot be looked at. */
bool identity_of(int fd, struct file_identity *out);
bool identity_at(int folder, const char *path, struct file_identity *out);
bool identity_same(const struct file_identity *a, const struct file_identity *b);
const struct file_identity *dataset_identity(const struct dataset *dataset);

#endif
