/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Files that are open while they are read, and after that as long as descriptors suffice: least recently used ones are
 * closed, and opened again by their path when they are needed. A file that is another one by then counts as gone. Any
 * thread may call.
 */
#ifndef TETLOD_SERVER_OPEN_FILES_H
#define TETLOD_SERVER_OPEN_FILES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

/* Tells whether a file is still what was opened. */
struct file_identity {
    uint64_t device, inode, size, links;
    struct timespec written, changed; /* the first can be set at will, the second not */
};

/* False if it is not a regular file, or cannot be looked at. */
bool identity_of(int fd, struct file_identity *out);
bool identity_at(int folder, const char *path, struct file_identity *out);

/* The same, of a file that nobody can change from now on without changing its identity. A file's times are those of a
 * clock that ticks every few milliseconds: this waits for the end of the tick in which it was changed last. False also
 * if it is changed again and again meanwhile; then *out is all zero. */
bool identity_settled(int fd, struct file_identity *out);

/* Whether nobody has written meanwhile. */
bool identity_same(const struct file_identity *a, const struct file_identity *b);

/* The same, of a file that may have got or lost a name, which changes a time as well: a file that was replaced by
 * another one. Somebody may have written. */
bool identity_same_but_names(const struct file_identity *a, const struct file_identity *b);

struct open_files;
struct open_file;

/* Of at most so many descriptors, beside those in use. NULL if memory is out. Freed when it has no files any more. */
struct open_files *open_files_new(size_t most);
void open_files_free(struct open_files *files);

/* How many are open. */
size_t open_files_count(struct open_files *files);

/* Takes over `fd`, which is open under the path, also on failure. NULL if memory is out. */
struct open_file *open_file_new(struct open_files *files, const char *path, int fd,
                                const struct file_identity *identity);
void open_file_free(struct open_file *file);

/* The file's descriptor until it is let go, or -1 with errno: ESTALE if there is another file now. */
int open_file_use(struct open_file *file);
void open_file_let_go(struct open_file *file);

/* Looking at a file may take for ever, on a network's file system. Each look begins and ends with these; the number of
 * the look is the caller's to keep. */
size_t open_files_begin_look(struct open_files *files);
void open_files_end_look(struct open_files *files, size_t look);

/* How many looks take longer than so many seconds. */
size_t open_files_hanging(struct open_files *files, double seconds);

#endif
