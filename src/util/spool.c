/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include "src/util/spool.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/util/file.h"

const char *spool_folder(void)
{
    const char *named = getenv("TMPDIR");
    return named && *named ? named : "/tmp";
}

bool spool_in_memory(void)
{
    enum { TMPFS = 0x01021994 };
    struct statfs about;
    return statfs(spool_folder(), &about) == 0 && about.f_type == TMPFS;
}

/* For file systems that have no files without a name. */
static int open_and_remove(const char *folder)
{
    char path[4096];
    if (snprintf(path, sizeof path, "%s/tetlod-XXXXXX", folder) >= (int)sizeof path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    int fd = mkostemp(path, O_CLOEXEC);
    if (fd >= 0)
        unlink(path);
    return fd;
}

int spool_file(void)
{
    int fd = open(spool_folder(), O_TMPFILE | O_RDWR | O_EXCL | O_CLOEXEC, 0600);
    return fd < 0 ? open_and_remove(spool_folder()) : fd;
}

enum tetlod_status spool_open(struct spool *out, struct tetlod_error *error)
{
    int fd = spool_file();
    *out = (struct spool){.file = fd >= 0 ? fdopen(fd, "w+") : NULL};
    if (out->file)
        return TETLOD_OK;
    enum tetlod_status status = tetlodi_fail(
        error, TETLOD_ERR_IO, "there is no temporary file in %.100s: %s; --scratch or TMPDIR names another folder",
        spool_folder(), strerror(errno));
    if (fd >= 0)
        close(fd);
    return status;
}

void spool_close(struct spool *spool)
{
    if (spool->file)
        fclose(spool->file);
    *spool = (struct spool){0};
}

static enum tetlod_status fail_write(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_IO,
                        "a temporary file in %.100s cannot be written: %s; --scratch or TMPDIR names another folder",
                        spool_folder(), strerror(errno));
}

enum tetlod_status spool_write(struct spool *spool, const void *bytes, size_t size, struct tetlod_error *error)
{
    if (size && fwrite(bytes, 1, size, spool->file) != size) // `bytes` of nothing may be NULL
        return fail_write(error);
    spool->size += size;
    return TETLOD_OK;
}

static enum tetlod_status read_spool(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    const struct file_input file = {.fd = fileno(opaque)};
    return file_input_read(&file, (size_t)offset, size, buffer) == size ? TETLOD_OK : TETLOD_ERR_IO;
}

enum tetlod_status spool_source(struct spool *spool, struct tetlod_source *out, struct tetlod_error *error)
{
    *out = (struct tetlod_source){read_spool, spool->file, spool->size};
    return fflush(spool->file) == 0 ? TETLOD_OK : fail_write(error);
}
