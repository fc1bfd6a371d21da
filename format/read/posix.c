/* SPDX-License-Identifier: BSD-3-Clause */
/* The only part of the library that needs POSIX: streams in files. Leave it out elsewhere, and give tetlod_open a
 * source. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#ifndef _FILE_OFFSET_BITS
#define _FILE_OFFSET_BITS 64
#endif

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "format/fail.h"

static enum tetlod_status read_fd(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    int fd = (int)(intptr_t)opaque;
    for (size_t done = 0; done < size;) {
        ssize_t got = pread(fd, (char *)buffer + done, size - done, (off_t)(offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return TETLOD_ERR_IO;
        done += (size_t)got;
    }
    return TETLOD_OK;
}

enum tetlod_status tetlod_open_fd(struct tetlod_file **out, int fd, const struct tetlod_options *options,
                                  struct tetlod_error *error)
{
    struct stat about;
    *out = NULL;
    if (fstat(fd, &about) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot read the stream: %s", strerror(errno));
    struct tetlod_source source = {read_fd, (void *)(intptr_t)fd, (uint64_t)about.st_size};
    return tetlod_open(out, &source, options, error);
}
