/* SPDX-License-Identifier: BSD-3-Clause */
/* An open stream: immutable and counted. It is found by id in the catalogue's table; an id never becomes part of a
 * path. Where the mesh changes from step to step, each topology group (SPEC 3.8) is a dataset: the first one is the
 * whole stream, the others are streams of their own inside its file. All of them have its id and are held and released
 * as one. */
#ifndef TETLOD_SERVER_DATASET_H
#define TETLOD_SERVER_DATASET_H

#include <stdatomic.h>
#include <stdbool.h>

#include "format/tetlod.h"
#include "server/store/open_files.h"

enum { ID_CAPACITY = 129 }; // 128 bytes and the NUL

struct dataset;

/* Takes over `fd`, which is open under the path, also on failure. Id and path are copied. The identity is settled. */
TETLOD_CHECKED enum tetlod_status dataset_open(struct dataset **out, const char *id, struct open_files *files,
                                               const char *path, int fd,
                                               const struct file_identity *identity, struct tetlod_error *error);

struct dataset *dataset_hold(struct dataset *dataset);
void dataset_release(struct dataset *dataset);

/* A topology group of the whole stream. Number 0 is the dataset itself. */
struct dataset *dataset_topology(struct dataset *whole, uint32_t topology);

/* The whole stream or its topology group that has this content id, of `size` characters; NULL if none has. */
struct dataset *dataset_with_content(struct dataset *whole, const char *cid, size_t size);

/* Number of this topology group, and how many steps the groups before it have. Both are 0 where there is one mesh. */
uint32_t dataset_topology_number(const struct dataset *dataset);
uint32_t dataset_steps_before(const struct dataset *dataset);

const char *dataset_id(const struct dataset *dataset);

/* Tells the dataset's file from others, whose streams may be the same: what is read of one must not wait for the
 * other. */
uint64_t dataset_file_number(const struct dataset *dataset);

const struct tetlod_info *dataset_info(const struct dataset *dataset);

/* What the headers of a level's answers say, printed once. */
struct level_texts {
    char level[12], vertices[12], tets[12];
    /* "max=0.01, sampled=0.008": of each known measure the largest over the controlled fields; or "" */
    char errors[96];
    char uncontrolled[64]; /* "fields=2, sampled=0.6": fields without a limit, their largest measured error; or "" */
};

const struct level_texts *dataset_level_texts(const struct dataset *dataset, uint32_t level);

/* Reads stored bytes of the dataset's own stream. They are the stream's: each part of it that they lie in (a frame, a
 * section) was held against its digest since somebody may have written into the file. ERR_CHECKSUM, ERR_TRUNCATED: the
 * file is damaged, or is being written. ERR_MISMATCH: it is gone, or another file has its place. ERR_IO, ERR_NOMEM.
 * Takes its time. */
TETLOD_CHECKED enum tetlod_status dataset_read(struct dataset *dataset, uint64_t offset, void *out, size_t size,
                                               struct tetlod_error *error);

struct tetlod_file *dataset_file(struct dataset *dataset);

/* The steps in time, to be read only; NULL if it has one moment. */
const struct tetlod_series *dataset_series(const struct dataset *dataset);

/* Holds the file against its digests, as far as that was not done before; ends early with ERR_LIMIT if `stop` becomes
 * true. */
TETLOD_CHECKED enum tetlod_status dataset_check(struct dataset *dataset, const atomic_bool *stop,
                                                struct tetlod_error *error);

/* Whether somebody has been reading the file for so long that nobody else should begin to. */
bool dataset_hangs(const struct dataset *dataset);

/* Whether the whole file was held against its digests; whether a part was found damaged. */
bool dataset_checked(const struct dataset *dataset);
bool dataset_damaged(const struct dataset *dataset);

/* False once the bytes were written over in place. Another file under its name is no such thing. */
bool dataset_intact(struct dataset *dataset);

#endif
