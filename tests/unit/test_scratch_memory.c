/* SPDX-License-Identifier: BSD-3-Clause */
/* Arrays in files: what is resident stays below the limit while threads go through them as fast as they can. */
#define _GNU_SOURCE // syscall
#include <fcntl.h>
#include <linux/userfaultfd.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "src/cli/scratch_memory.h"
#include "src/util/parallel.h"
#include "tests/test.h"

enum { MEGABYTE = 1 << 20, LIMIT = 72 * MEGABYTE, ARRAYS = 3, BYTES = 80 * MEGABYTE, PASSES = 4 };

static size_t peak(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (size_t)usage.ru_maxrss << 10;
}

struct arrays {
    uint64_t *numbers[ARRAYS];
    uint64_t sums[ARRAYS];
};

/* A worker's array: every pass adds one to each number. */
static void add_up(void *opaque, unsigned worker, size_t begin, size_t end)
{
    struct arrays *arrays = opaque;
    (void)worker;
    for (size_t a = begin; a < end; a++)
        for (int pass = 0; pass < PASSES; pass++)
            for (size_t i = 0; i < BYTES / sizeof(uint64_t); i++)
                arrays->sums[a] += ++arrays->numbers[a][i];
}

static void test_stays_below(void)
{
    struct arrays arrays = {0};
    if (SANITIZED)
        SKIP("what sanitizers take is resident, too");
    REQUIRE(scratch_memory_begin(LIMIT, NULL) == TETLOD_OK);
    struct pool *pool = pool_new(ARRAYS); // its threads are watched
    REQUIRE(pool);
    for (int a = 0; a < ARRAYS; a++)
        REQUIRE((arrays.numbers[a] = calloc(BYTES / sizeof(uint64_t), sizeof(uint64_t))));
    CHECK(scratch_memory_peak() >= (uint64_t)ARRAYS * BYTES);
    pool_run(pool, ARRAYS, 1, add_up, &arrays);
    for (int a = 0; a < ARRAYS; a++) {
        CHECK(arrays.sums[a] == (uint64_t)(BYTES / sizeof(uint64_t)) * PASSES * (PASSES + 1) / 2);
        free(arrays.numbers[a]);
    }
    pool_free(pool);
    if (peak() > LIMIT)
        TEST_FAIL("%zu MB were resident", peak() / MEGABYTE);
}

/* What fits stays in memory; what grows keeps its numbers. */
static void test_grows(void)
{
    if (SANITIZED)
        SKIP("what sanitizers take is resident, too");
    size_t count = 0;
    uint64_t *numbers = NULL, before = scratch_memory_peak();
    for (size_t size = MEGABYTE; size <= 64 * (size_t)MEGABYTE; size *= 2) {
        uint64_t *grown = realloc(numbers, size);
        REQUIRE(grown);
        numbers = grown;
        for (; count < size / sizeof *numbers; count++)
            numbers[count] = count;
    }
    size_t wrong = 0;
    for (size_t i = 0; i < count; i++)
        wrong += numbers[i] != i;
    CHECK(wrong == 0);
    CHECK(scratch_memory_peak() == before);
    free(numbers);
}

/* Bytes that are there again after their pages were taken: of memory none are. */
static size_t survivors(unsigned char *bytes, size_t size)
{
    size_t count = 0;
    memset(bytes, 1, size);
    CHECK(madvise(bytes, size, MADV_DONTNEED) == 0);
    for (size_t i = 0; i < size; i++)
        count += bytes[i];
    return count;
}

/* What is memory becomes a file where it is, with what is in it, and others have its share. */
static void test_settles(void)
{
    enum { SIZE = LIMIT / 6, LARGE = LIMIT / 3 };
    if (SANITIZED)
        SKIP("what sanitizers take is resident, too");
    unsigned char *first = malloc(SIZE);
    REQUIRE(first);
    CHECK_INT(survivors(first, SIZE), 0);
    memset(first, 2, SIZE);
    scratch_memory_settle(true);
    CHECK(first[0] == 2 && first[SIZE - 1] == 2);
    CHECK_INT(survivors(first, SIZE), SIZE);
    unsigned char *second = malloc(LARGE);
    REQUIRE(second);
    CHECK_INT(survivors(second, LARGE), 0);
    scratch_memory_settle(false);
    free(first);
    free(second);
    second = malloc(LARGE);
    REQUIRE(second);
    CHECK_INT(survivors(second, LARGE), LARGE); // more than the share
    free(second);
}

/* Linux 6.7 and later, outside of containers that forbid it. */
static bool brings_single_pages(void)
{
    struct uffdio_api api = {.api = UFFD_API, .features = 1 << 15};
    int file = (int)syscall(SYS_userfaultfd, 1 | O_CLOEXEC);
    bool can = file >= 0 && ioctl(file, UFFDIO_API, &api) == 0;
    if (file >= 0)
        close(file);
    return can;
}

static size_t resident(void)
{
    unsigned long all = 0, pages = 0;
    FILE *statm = fopen("/proc/self/statm", "r");
    bool read = statm && fscanf(statm, "%lu %lu", &all, &pages) == 2;
    CHECK(read);
    if (statm)
        fclose(statm);
    return pages * (size_t)sysconf(_SC_PAGESIZE);
}

/* One page in sixteen is looked at: the others do not come with it, which would take the place of what is needed. */
static void test_single_pages(void)
{
    enum { PAGE = 4096, APART = 16 * PAGE, SIZE = LIMIT / 2 };
    if (SANITIZED || !brings_single_pages())
        SKIP("here the system brings in several pages at once");
    volatile char *bytes = malloc(SIZE);
    REQUIRE(bytes);
    for (size_t at = 0; at < SIZE; at += PAGE)
        bytes[at] = 1;
    REQUIRE(madvise((void *)(uintptr_t)bytes, SIZE, MADV_DONTNEED) == 0); // all is in the file
    size_t before = resident(), sum = 0;
    for (size_t at = 0; at < SIZE; at += APART)
        sum += (size_t)bytes[at];
    CHECK(sum == SIZE / APART); // it is not memory
    size_t more = resident() - before;
    if (more > SIZE / 4)
        TEST_FAIL("%zu MB came with %d MB", more / MEGABYTE, (int)(SIZE / APART * PAGE / MEGABYTE));
    free((void *)(uintptr_t)bytes);
}

/* What is allowed later is used, and what was allowed is not taken back. */
static void test_allowed_later(void)
{
    enum { SIZE = 64 * MEGABYTE };
    if (SANITIZED)
        SKIP("what sanitizers take is resident, too");
    scratch_memory_allow(3 * (uint64_t)LIMIT);
    scratch_memory_allow(LIMIT);
    volatile char *bytes = malloc(2 * SIZE); // a region of a file: for memory it is too large
    REQUIRE(bytes);
    size_t before = resident();
    for (size_t at = 0; at < 2 * SIZE; at += 4096)
        bytes[at] = 1;
    CHECK(resident() - before > SIZE + SIZE / 2); // more than the whole limit before
    free((void *)(uintptr_t)bytes);
}

/* A file that was freed comes again, but not where zeros are asked for; nor in a child, whose parent may go on with
 * it. */
static void test_freed_files(void)
{
    enum { SIZE = LIMIT / 2 };
    if (SANITIZED)
        SKIP("what sanitizers take is resident, too");
    volatile unsigned char *bytes = malloc(SIZE), *others = malloc(SIZE);
    REQUIRE(bytes && others);
    bytes[SIZE - 1] = others[SIZE - 1] = 0xff;
    free((void *)(uintptr_t)bytes);
    bytes = malloc(SIZE);
    REQUIRE(bytes);
    CHECK_INT(bytes[SIZE - 1], 0xff);
    free((void *)(uintptr_t)bytes);
    bytes = calloc(SIZE, 1);
    REQUIRE(bytes);
    CHECK_INT(bytes[SIZE - 1], 0);
    pid_t child = fork();
    if (child == 0) {
        free((void *)(uintptr_t)others);
        bytes = malloc(SIZE);
        if (bytes)
            bytes[SIZE - 1] = 2;
        _exit(bytes ? 0 : 1);
    }
    int ended = 1;
    CHECK(child > 0 && waitpid(child, &ended, 0) == child && ended == 0);
    CHECK_INT(others[SIZE - 1], 0xff);
    free((void *)(uintptr_t)bytes);
    free((void *)(uintptr_t)others);
}

int main(void)
{
    RUN(test_stays_below);
    RUN(test_single_pages);
    RUN(test_grows);
    RUN(test_settles);
    RUN(test_freed_files);
    RUN(test_allowed_later);
    return test_end();
}
