/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The streams that are served, by id. Built from paths: files, and folders of *.tetlod, and of *.vtkhdf with a stream
 * in them, that are looked through again at every scan. A stream that was replaced by another file stays for those who
 * still read it, until nobody has asked for its content id for a while; one that was written over in place is gone at
 * once. Finding may be done by any thread, scanning by one at a time.
 */
#ifndef TETLOD_SERVER_CATALOGUE_H
#define TETLOD_SERVER_CATALOGUE_H

#include "server/store/dataset.h"

struct catalogue;

struct catalogue_options {
    const char *const *paths; /* copied */
    size_t path_count;
    double keep_replaced; /* seconds without a request after which a replaced stream goes */
    /* bytes that the first scan holds against their digests before it lists them. 0: 256 MB */
    uint64_t checked_at_once;
    size_t most_files;    /* that stay open; the others are opened when they are read. 0: all */
    void (*log)(void *opaque, const char *level, const char *message);
    void *log_opaque;
};

/* Every path must exist, and a path that is a file must be a stream; files of a folder that are not
 * streams are logged and left out. */
TETLOD_CHECKED enum tetlod_status catalogue_open(struct catalogue **out, const struct catalogue_options *options,
                                                 struct tetlod_error *error);
void catalogue_close(struct catalogue *catalogue);

/* Takes up what changed on disk. What cannot be looked at now, for any reason but that it is gone, stays as it was.
 * `now` is a monotonic time in seconds. */
void catalogue_scan(struct catalogue *catalogue, double now);

/* Makes a scan end soon, in a large file that it holds against its digests or before the next. */
void catalogue_stop(struct catalogue *catalogue);

/* The current stream of an id, or NULL; the caller releases it. */
struct dataset *catalogue_find(struct catalogue *catalogue, const char *id);

/* The stream of an id, or the topology group of it, with this content id, current or replaced, or NULL. */
struct dataset *catalogue_find_content(struct catalogue *catalogue, const char *id, const char *cid, double now);

/* The current streams by id, `most` at most, each held, in an array that the caller frees; NULL if memory is out.
 * `out_digest`: the number that catalogue_digest gives of just these; may be NULL. */
struct dataset **catalogue_list(struct catalogue *catalogue, size_t most, size_t *out_count, uint64_t *out_digest);

/* A number that tells what is listed: of ids and content ids. */
uint64_t catalogue_digest(struct catalogue *catalogue);

/* Whether a stream or a topology group with this content id is there, current or replaced. */
bool catalogue_has_content(struct catalogue *catalogue, const char *cid, size_t size);

/* How many files and folders the last scan could not look at. */
size_t catalogue_troubles(struct catalogue *catalogue);

/* How many files are open, and how many looks at one take longer than so many seconds. */
size_t catalogue_open_files(struct catalogue *catalogue);
size_t catalogue_hanging(struct catalogue *catalogue, double seconds);

size_t catalogue_count(struct catalogue *catalogue);

#endif
