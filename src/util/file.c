/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE // O_TMPFILE
#include "src/util/file.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/temporary.h"

static enum tetlod_status fail_errno(struct tetlod_error *error, const char *path, const char *doing)
{
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot %s: %s", path, doing, strerror(errno));
}

enum tetlod_status file_input_open(struct file_input *out, const char *path, struct tetlod_error *error)
{
    struct stat about;
    *out = (struct file_input){-1, 0};
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); // a pipe without a writer is refused, not waited for
    if (fd < 0)
        return fail_errno(error, path, "open");
    enum tetlod_status status = TETLOD_OK;
    if (fstat(fd, &about) != 0)
        status = fail_errno(error, path, "read");
    else if (S_ISDIR(about.st_mode))
        status = tetlodi_fail(error, TETLOD_ERR_IO, "%s: is a directory, not a file", path);
    else if (!S_ISREG(about.st_mode))
        status = tetlodi_fail(error, TETLOD_ERR_IO, "%s: is not a regular file", path);
    if (status == TETLOD_OK)
        *out = (struct file_input){fd, (size_t)about.st_size};
    else
        close(fd);
    return status;
}

void file_input_close(struct file_input *file)
{
    if (file->fd >= 0)
        close(file->fd);
    file->fd = -1;
}

size_t file_input_read(const struct file_input *file, size_t at, size_t size, void *out)
{
    size_t done = 0;
    while (done < size) {
        ssize_t got = pread(file->fd, (char *)out + done, size - done, (off_t)(at + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            break; // it shrank meanwhile, or cannot be read
        done += (size_t)got;
    }
    return done;
}

bool file_same(const char *one, const char *other)
{
    struct stat a, b;
    return stat(one, &a) == 0 && stat(other,
                                      &b) == 0 && S_ISREG(a.st_mode) && a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

enum tetlod_status file_input_whole(const struct file_input *file, const char *path, unsigned char **out_bytes,
                                    size_t *out_size,
                                    struct tetlod_error *error)
{
    unsigned char *bytes = array_new(file->size, 1);
    if (!bytes)
        return tetlodi_fail(error, TETLOD_ERR_NOMEM, "%s: out of memory (the file has %zu bytes)", path, file->size);
    errno = 0;
    size_t done = file_input_read(file, 0, file->size, bytes);
    if (done < file->size && errno) {
        free(bytes);
        return fail_errno(error, path, "read");
    }
    *out_bytes = bytes;
    *out_size = done; // if it shrank meanwhile, the reader will say what is missing
    return TETLOD_OK;
}

enum tetlod_status file_view_open(struct file_view *out, const struct file_input *file, const char *path,
                                  struct tetlod_error *error)
{
    *out = (struct file_view){.size = file->size};
    void *bytes = file->size ? mmap(NULL, file->size, PROT_READ, MAP_PRIVATE, file->fd, 0) : MAP_FAILED;
    out->is_mapped = bytes != MAP_FAILED;
    if (!out->is_mapped)
        return file_input_whole(file, path, &out->bytes, &out->size, error);
    out->bytes = bytes;
    return TETLOD_OK;
}

enum tetlod_status file_view_path(struct file_view *out, const char *path, struct tetlod_error *error)
{
    struct file_input file;
    *out = (struct file_view){0};
    TETLOD_TRY(file_input_open(&file, path, error));
    enum tetlod_status status = file_view_open(out, &file, path, error);
    file_input_close(&file);
    return status;
}

void file_view_close(struct file_view *view)
{
    if (view->is_mapped)
        munmap(view->bytes, view->size);
    else
        free(view->bytes);
    *view = (struct file_view){0};
}

void file_view_release(struct file_view *view)
{
    if (view->is_mapped)
        madvise(view->bytes, view->size, MADV_DONTNEED);
}

/* The list of what is mapped, byte by byte: nothing here may allocate. */
struct maps {
    int fd;
    char buffer[512];
    ssize_t used, at;
};

/* -1: its end. */
static int next_byte(struct maps *maps)
{
    if (maps->at == maps->used) {
        maps->at = 0;
        maps->used = read(maps->fd, maps->buffer, sizeof maps->buffer);
        if (maps->used <= 0) {
            maps->used = 0;
            return -1;
        }
    }
    return (unsigned char)maps->buffer[maps->at++];
}

/* A number and the byte behind it. */
static uintptr_t take_address(struct maps *maps)
{
    uintptr_t number = 0;
    for (int c; (c = next_byte(maps)) > ' ' && c != '-';)
        number = number * 16 + (uintptr_t)(c <= '9' ? c - '0' : c - 'a' + 10);
    return number;
}

bool file_mapped_at(const void *address, char *path, size_t size)
{
    struct maps maps = {.fd = open("/proc/self/maps", O_RDONLY | O_CLOEXEC)};
    bool found = false;
    path[0] = 0;
    for (int c = 0; c >= 0 && !found;) {
        uintptr_t begin = take_address(&maps), end = take_address(&maps);
        size_t length = 0;
        found = (uintptr_t)address >= begin && (uintptr_t)address < end;
        while ((c = next_byte(&maps)) >= 0 && c != '\n')
            if ((length || c == '/') && length + 1 < size)
                path[length++] = (char)c;
        path[length] = 0;
    }
    if (maps.fd >= 0)
        close(maps.fd);
    return found && path[0];
}

enum tetlod_status file_read(const char *path, unsigned char **out_bytes, size_t *out_size, struct tetlod_error *error)
{
    struct file_input file;
    *out_bytes = NULL;
    *out_size = 0;
    TETLOD_TRY(file_input_open(&file, path, error));
    enum tetlod_status status = file_input_whole(&file, path, out_bytes, out_size, error);
    file_input_close(&file);
    return status;
}

/* Where the file goes while it is written: to a file without a name, which vanishes with the process; where a file
 * system has no such files, to one with a temporary name; to a device or pipe straight. */
enum output_kind { OUTPUT_UNNAMED, OUTPUT_TEMPORARY, OUTPUT_STRAIGHT };

struct file_output {
    enum output_kind kind;
    FILE *stream;
    char *path, *temporary;
    size_t temporary_size;
    struct temporary *guard; /* of a temporary name */
    int failed_errno;
};

static void output_free(struct file_output *output)
{
    temporary_end(output->guard);
    free(output->path);
    free(output->temporary);
    free(output);
}

static struct file_output *output_new(const char *path)
{
    struct file_output *output = array_zero(1, sizeof *output);
    if (!output)
        return NULL;
    output->temporary_size = strlen(path) + 64;
    output->path = strdup(path);
    output->temporary = array_new(output->temporary_size, 1);
    if (output->path && output->temporary)
        return output;
    output_free(output);
    return NULL;
}

static int open_unnamed(struct file_output *output)
{
    snprintf(output->temporary, output->temporary_size, "%s", output->path);
    char *slash = strrchr(output->temporary, '/');
    snprintf(slash ? slash + 1 : output->temporary, 2, ".");
    if (access("/proc/self/fd", X_OK) != 0) // by which it gets its name at last
        return -1;
    return open(output->temporary, O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
}

static int open_temporary(struct file_output *output)
{
    snprintf(output->temporary, output->temporary_size, "%s.XXXXXX", output->path);
    int fd = temporary_open(&output->guard, output->temporary);
    mode_t mask = umask(0);
    umask(mask);
    if (fd >= 0 && fchmod(fd, 0666 & ~mask) != 0) {
        close(fd);
        unlink(output->temporary);
        return -1;
    }
    return fd;
}

static int open_output(struct file_output *output)
{
    struct stat about;
    if (stat(output->path, &about) == 0 && !S_ISREG(about.st_mode)) {
        output->kind = OUTPUT_STRAIGHT;
        return open(output->path, O_WRONLY | O_CLOEXEC);
    }
    output->kind = OUTPUT_UNNAMED;
    int fd = open_unnamed(output);
    if (fd >= 0)
        return fd;
    output->kind = OUTPUT_TEMPORARY;
    return open_temporary(output);
}

static enum tetlod_status fail_create(struct tetlod_error *error, const char *path)
{
    if (errno != ENOENT)
        return fail_errno(error, path, "create");
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot create: its folder is not there; make the folder first",
                        path);
}

enum tetlod_status file_output_open(struct file_output **out, const char *path, struct tetlod_error *error)
{
    *out = NULL;
    struct stat about;
    if (stat(path, &about) == 0 && S_ISDIR(about.st_mode))
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is a directory; give the name of a file in it", path);
    struct file_output *output = output_new(path);
    if (!output)
        return tetlodi_fail_nomem(error, "an output file", strlen(path));
    int fd = open_output(output);
    output->stream = fd >= 0 ? fdopen(fd, "wb") : NULL;
    if (!output->stream) {
        enum tetlod_status status = fail_create(error, path);
        if (fd >= 0) {
            close(fd);
            if (output->kind == OUTPUT_TEMPORARY)
                unlink(output->temporary);
        }
        output_free(output);
        return status;
    }
    *out = output;
    return TETLOD_OK;
}

static enum tetlod_status output_write(void *opaque, const void *bytes, size_t size)
{
    struct file_output *output = opaque;
    if (!size || fwrite(bytes, 1, size, output->stream) == size)
        return TETLOD_OK;
    output->failed_errno = errno;
    return TETLOD_ERR_IO;
}

struct tetlodi_sink file_output_sink(struct file_output *output)
{
    return (struct tetlodi_sink){output_write, output};
}

/* Gives the unnamed file its name: in one step where there is none of that name, else by way of a rename. */
static bool name_output(struct file_output *output)
{
    enum { TRIES = 100 };
    char self[64];
    snprintf(self, sizeof self, "/proc/self/fd/%d", fileno(output->stream));
    if (linkat(AT_FDCWD, self, AT_FDCWD, output->path, AT_SYMLINK_FOLLOW) == 0)
        return true;
    sigset_t all, before; // a signal between the two steps would leave a file of the temporary name
    bool named = false;
    int failed = errno;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    errno = failed;
    for (int i = 0; errno == EEXIST && i < TRIES; i++) {
        snprintf(output->temporary, output->temporary_size, "%s.%ld-%d", output->path, (long)getpid(), i);
        if (linkat(AT_FDCWD, self, AT_FDCWD, output->temporary, AT_SYMLINK_FOLLOW) != 0)
            continue;
        output->kind = OUTPUT_TEMPORARY;
        named = rename(output->temporary, output->path) == 0;
        break;
    }
    int why = errno;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    errno = why;
    return named;
}

enum tetlod_status file_output_commit(struct file_output *output, struct tetlod_error *error)
{
    errno = output->failed_errno;
    bool good = !output->failed_errno && fflush(output->stream) == 0;
    if (good && output->kind != OUTPUT_STRAIGHT)
        good = fsync(fileno(output->stream)) == 0;
    if (good && output->kind == OUTPUT_UNNAMED)
        good = name_output(output);
    else if (good && output->kind == OUTPUT_TEMPORARY)
        good = rename(output->temporary, output->path) == 0;
    if (!good) {
        enum tetlod_status status = fail_errno(error, output->path, "write");
        file_output_abort(output);
        return status;
    }
    fclose(output->stream); // all has been flushed
    output_free(output);
    return TETLOD_OK;
}

enum tetlod_status file_output_finish(struct file_output *output, enum tetlod_status status, struct tetlod_error *error)
{
    if (status == TETLOD_OK || output->failed_errno)
        return file_output_commit(output, error);
    file_output_abort(output);
    return status;
}

void file_output_abort(struct file_output *output)
{
    if (!output)
        return;
    fclose(output->stream);
    if (output->kind == OUTPUT_TEMPORARY)
        unlink(output->temporary);
    output_free(output);
}

enum tetlod_status file_output_check(const char *path, struct tetlod_error *error)
{
    struct stat about;
    struct file_output *output;
    if (stat(path, &about) == 0 && !S_ISREG(about.st_mode) && !S_ISDIR(about.st_mode))
        return TETLOD_OK; // who reads a pipe would take an end for that of the output
    TETLOD_TRY(file_output_open(&output, path, error));
    file_output_abort(output);
    return TETLOD_OK;
}

enum tetlod_status file_write(const char *path, const void *bytes, size_t size, struct tetlod_error *error)
{
    struct file_output *output;
    TETLOD_TRY(file_output_open(&output, path, error));
    const struct tetlodi_sink sink = file_output_sink(output);
    return file_output_finish(output, sink.write(sink.opaque, bytes, size), error);
}
