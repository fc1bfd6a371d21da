/* SPDX-License-Identifier: BSD-3-Clause */
/* Files as a whole: bytes in, and an output that appears complete or not at all. */
#ifndef TETLOD_FILE_H
#define TETLOD_FILE_H

#include <stdbool.h>

#include "format/common/sink.h"

/* Reads a regular file into an exact-size heap block that the caller frees. ERR_IO names path and reason. */
TETLOD_CHECKED enum tetlod_status file_read(const char *path, unsigned char **out_bytes, size_t *out_size,
                                            struct tetlod_error *error);

/* A regular file that is read range by range, by any number of threads. */
struct file_input {
    int fd;
    size_t size;
};
TETLOD_CHECKED enum tetlod_status file_input_open(struct file_input *out, const char *path, struct tetlod_error *error);
void file_input_close(struct file_input *file);

/* How many bytes it read from `at` on: fewer than `size` where the file ends or cannot be read. */
size_t file_input_read(const struct file_input *file, size_t at, size_t size, void *out);

/* file_read of a file that is open. */
TETLOD_CHECKED enum tetlod_status file_input_whole(const struct file_input *file, const char *path,
                                                   unsigned char **out_bytes,
                                                   size_t *out_size, struct tetlod_error *error);

/*
 * A file's bytes, which the system brings into memory where they are looked at. A reader that says how far it is gives
 * those behind it back, so that a file takes no memory beside what is made of it. Where the file cannot be mapped, it
 * is a copy.
 */
struct file_view {
    unsigned char *bytes;
    size_t size, passed;
    bool is_mapped;
};
TETLOD_CHECKED enum tetlod_status file_view_open(struct file_view *out, const struct file_input *file, const char *path,
                                                 struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status file_view_path(struct file_view *out, const char *path, struct tetlod_error *error);
void file_view_close(struct file_view *view);

/* Gives back the memory of what has been looked at; it can be looked at again. */
void file_view_release(struct file_view *view);

/* The same once in a while, for a reader that has come to `at`. NULL: bytes that are in memory anyway. */
static inline void file_view_pass(struct file_view *view, const void *at)
{
    enum { STRIDE = 1 << 21 };
    if (!view || (size_t)((const unsigned char *)at - view->bytes) - view->passed < STRIDE)
        return;
    view->passed = (size_t)((const unsigned char *)at - view->bytes);
    file_view_release(view);
}

/* The path of the file that is mapped at an address; false if there is none. For a handler of signals, too. */
bool file_mapped_at(const void *address, char *path, size_t size);

/* Are two paths one regular file, whatever links are on the way? */
bool file_same(const char *one, const char *other);

/* An output that commit puts in its place in one step and abort takes back; a process that is killed between leaves
 * nothing. To a device or pipe it is written straight. */
struct file_output;
TETLOD_CHECKED enum tetlod_status file_output_open(struct file_output **out, const char *path,
                                                   struct tetlod_error *error);
struct tetlodi_sink file_output_sink(struct file_output *output);
/* frees it */
TETLOD_CHECKED enum tetlod_status file_output_commit(struct file_output *output, struct tetlod_error *error);
void file_output_abort(struct file_output *output);
/* Commits after `status` OK, else takes back; where the file itself failed, the error names path and reason. Frees
 * it. */
TETLOD_CHECKED enum tetlod_status file_output_finish(struct file_output *output, enum tetlod_status status,
                                                     struct tetlod_error *error);

/* Can an output be opened there? For those who work long before they write: nothing is left, nothing is replaced. */
TETLOD_CHECKED enum tetlod_status file_output_check(const char *path, struct tetlod_error *error);

/* All of it at once. */
TETLOD_CHECKED enum tetlod_status file_write(const char *path, const void *bytes, size_t size,
                                             struct tetlod_error *error);

#endif
