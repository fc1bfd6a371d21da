/* SPDX-License-Identifier: BSD-3-Clause */
/* The child sends what it has read through a pipe (block_carrier.h). */
#include "src/io/services/contain.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/io/services/block_carrier.h"
#include "src/util/pages.h"

/* ---- the pipe */

static bool send_bytes(int fd, const void *bytes, size_t size)
{
    const unsigned char *at = bytes;
    while (size) {
        ssize_t sent = write(fd, at, size);
        if (sent < 0 && errno == EINTR)
            continue;
        if (sent <= 0)
            return false;
        at += sent;
        size -= (size_t)sent;
    }
    return true;
}

static bool take_bytes(int fd, void *bytes, size_t size)
{
    unsigned char *at = bytes;
    while (size) {
        ssize_t got = read(fd, at, size);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return false;
        at += got;
        size -= (size_t)got;
    }
    return true;
}

/* A carrier of blocks: the child's array is freed, and given back while it is sent. */
static bool send_numbers(void *opaque, void *numbers, size_t count, unsigned width, unsigned lag)
{
    enum { PART = 1 << 20 };
    size_t size = count * width;
    bool good = true;
    (void)lag;
    for (size_t at = 0; good && at < size; at += PART) {
        size_t part = size - at < PART ? size - at : PART;
        good = send_bytes(*(int *)opaque, (char *)numbers + at, part);
        if (part == PART)
            pages_drop((char *)numbers + at, part);
    }
    return good;
}

static bool take_numbers(void *opaque, void *numbers, size_t count, unsigned width, unsigned lag)
{
    (void)lag;
    return take_bytes(*(int *)opaque, numbers, count * width);
}

/* ---- the two processes */

struct result {
    enum tetlod_status status;
    char message[sizeof((struct tetlod_error *)0)->message];
    struct io_report report;
    uint64_t blocks;
};

static void raise_limit(int resource, uint64_t more)
{
    struct rlimit limit;
    if (getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return;
    limit.rlim_cur = more < limit.rlim_max - limit.rlim_cur ? limit.rlim_cur + more : limit.rlim_max;
    setrlimit(resource, &limit);
}

void contain_expect(uint64_t size)
{
    enum { MAX_RATIO = 2400 }; // deflate reaches 1032, for numbers that take twice the room here
    raise_limit(RLIMIT_CPU, size >> 22);
    raise_limit(RLIMIT_AS, size < UINT64_MAX / MAX_RATIO ? size * MAX_RATIO : UINT64_MAX);
}

static void set_limit(int resource, rlim_t now)
{
    struct rlimit limit;
    if (getrlimit(resource, &limit) == 0 && now < limit.rlim_cur) {
        limit.rlim_cur = now;
        setrlimit(resource, &limit);
    }
}

/* Libraries trust the counts in a file: they may take a minute and a gigabyte, and what a file of that size is
 * worth. */
static void limit_child(size_t size)
{
    unsigned long pages = 0;
    FILE *about = fopen("/proc/self/statm", "r");
    if (about && fscanf(about, "%lu", &pages) == 1)
        set_limit(RLIMIT_AS, (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE) + (1u << 30));
    if (about)
        fclose(about);
    set_limit(RLIMIT_CPU, 60);
    set_limit(RLIMIT_CORE, 0);
    contain_expect(size);
}

/* What libraries print, and what a crash prints, is not for the user. */
static void be_silent(void)
{
    int nowhere = open("/dev/null", O_WRONLY);
    if (nowhere >= 0)
        dup2(nowhere, STDERR_FILENO);
}

static void run_child(contained_reader read_file, const struct io_input *input, const struct io_report *report, int fd)
{
    struct blocks blocks = {0};
    struct result result = {.report = *report};
    struct tetlod_error error = {.offset = UINT64_MAX};
    struct block_carrier carrier = {send_numbers, &fd, false, false};
    limit_child(input->size);
    be_silent();
    result.status = read_file(&blocks, input, &result.report, &error);
    memcpy(result.message, error.message, sizeof result.message);
    result.blocks = result.status == TETLOD_OK ? blocks.count : 0;
    bool good = send_bytes(fd, &result, sizeof result);
    for (size_t b = 0; good && b < result.blocks; b++)
        good = block_carry(&carrier, &blocks.at[b]);
}

static enum tetlod_status take_result(int fd, struct blocks *out, struct io_report *report, struct tetlod_error *error)
{
    struct result result;
    struct block *block;
    struct block_carrier carrier = {take_numbers, &fd, true, false};
    const char *format = report->format;
    if (!take_bytes(fd, &result, sizeof result))
        return tetlodi_fail(error, TETLOD_ERR_MESH,
                            "the library that reads this format fails on it: the file is damaged");
    result.message[sizeof result.message - 1] = 0;
    if (result.status != TETLOD_OK)
        return tetlodi_fail(error, result.status, "%s", result.message);
    *report = result.report;
    report->format = format;
    for (uint64_t b = 0; b < result.blocks; b++) {
        TETLOD_TRY(blocks_add(out, &block, error));
        if (!block_carry(&carrier, block))
            return tetlodi_fail(error, TETLOD_ERR_MESH,
                                "what was read of it does not arrive: out of memory, or it is damaged");
    }
    return TETLOD_OK;
}

enum tetlod_status contain_read(contained_reader read_file, struct blocks *out, const struct io_input *input,
                                struct io_report *report, struct tetlod_error *error)
{
    int ends[2], status_of_child;
    if (pipe(ends) != 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot make a pipe: %s", strerror(errno));
    pid_t child = fork();
    if (child < 0) {
        close(ends[0]);
        close(ends[1]);
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot start a process to read it: %s", strerror(errno));
    }
    if (child == 0) {
        close(ends[0]);
        run_child(read_file, input, report, ends[1]);
        _exit(0);
    }
    close(ends[1]);
    enum tetlod_status status = take_result(ends[0], out, report, error);
    close(ends[0]);
    while (waitpid(child, &status_of_child, 0) < 0 && errno == EINTR)
        ;
    return status;
}
