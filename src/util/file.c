/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/array.h"

static enum tetlod_status fail_errno(struct tetlod_error *error, const char *path, const char *doing)
{
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot %s: %s", path, doing, strerror(errno));
}

static enum tetlod_status read_open_file(int fd, const char *path, unsigned char **out_bytes, size_t *out_size,
                                         struct tetlod_error *error)
{
    struct stat about;
    if (fstat(fd, &about) != 0)
        return fail_errno(error, path, "read");
    if (S_ISDIR(about.st_mode))
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is a directory, not a file", path);
    if (!S_ISREG(about.st_mode))
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is not a regular file", path);
    size_t size = (size_t)about.st_size, done = 0;
    unsigned char *bytes = array_new(size, 1);
    if (!bytes)
        return tetlodi_fail(error, TETLOD_ERR_NOMEM, "%s: out of memory (the file has %zu bytes)", path, size);
    while (done < size) {
        ssize_t got = read(fd, bytes + done, size - done);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0) {
            free(bytes);
            return fail_errno(error, path, "read");
        }
        if (got == 0)
            break; // it shrank meanwhile: the reader will say what is missing
        done += (size_t)got;
    }
    *out_bytes = bytes;
    *out_size = done;
    return TETLOD_OK;
}

enum tetlod_status file_read(const char *path, unsigned char **out_bytes, size_t *out_size, struct tetlod_error *error)
{
    *out_bytes = NULL;
    *out_size = 0;
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return fail_errno(error, path, "open");
    enum tetlod_status status = read_open_file(fd, path, out_bytes, out_size, error);
    close(fd);
    return status;
}

struct file_output {
    FILE *stream;
    char *path, *temporary;
    int failed_errno;
};

static void output_free(struct file_output *output)
{
    free(output->path);
    free(output->temporary);
    free(output);
}

enum tetlod_status file_output_open(struct file_output **out, const char *path, struct tetlod_error *error)
{
    *out = NULL;
    struct stat about;
    if (stat(path, &about) == 0 && S_ISDIR(about.st_mode))
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is a directory; give the name of a file in it", path);
    struct file_output *output = array_zero(1, sizeof *output);
    size_t length = strlen(path) + sizeof ".XXXXXX";
    if (output) {
        output->path = strdup(path);
        output->temporary = array_new(length, 1);
    }
    if (!output || !output->path || !output->temporary) {
        if (output)
            output_free(output);
        return tetlodi_fail_nomem(error, "an output file", length);
    }
    snprintf(output->temporary, length, "%s.XXXXXX", path);
    int fd = mkstemp(output->temporary);
    mode_t mask = umask(0);
    umask(mask);
    if (fd >= 0 && fchmod(fd, 0666 & ~mask) == 0)
        output->stream = fdopen(fd, "wb");
    if (!output->stream) {
        enum tetlod_status status = fail_errno(error, path, "create");
        if (fd >= 0) {
            close(fd);
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
    if (fwrite(bytes, 1, size, output->stream) == size)
        return TETLOD_OK;
    output->failed_errno = errno;
    return TETLOD_ERR_IO;
}

struct tetlodi_sink file_output_sink(struct file_output *output)
{
    return (struct tetlodi_sink){output_write, output};
}

enum tetlod_status file_output_commit(struct file_output *output, struct tetlod_error *error)
{
    bool written = !output->failed_errno && fflush(output->stream) == 0 && fsync(fileno(output->stream)) == 0;
    if (!written) {
        errno = output->failed_errno ? output->failed_errno : errno;
        enum tetlod_status status = fail_errno(error, output->path, "write");
        file_output_abort(output);
        return status;
    }
    int closed = fclose(output->stream);
    output->stream = NULL;
    if (closed != 0 || rename(output->temporary, output->path) != 0) {
        enum tetlod_status status = fail_errno(error, output->path, "write");
        file_output_abort(output);
        return status;
    }
    output_free(output);
    return TETLOD_OK;
}

void file_output_abort(struct file_output *output)
{
    if (!output)
        return;
    if (output->stream)
        fclose(output->stream);
    unlink(output->temporary);
    output_free(output);
}
