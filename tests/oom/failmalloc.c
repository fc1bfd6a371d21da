/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * To be preloaded: makes allocations fail. From main's start on they are numbered from 1; FAILMALLOC_AT=N fails the
 * one, FAILMALLOC_FROM=N that one and all after it, FAILMALLOC_COUNT=PATH writes how many there were.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

/* glibc's own, which stay reachable when malloc and its kin are replaced */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

static atomic_ulong number;
static unsigned long fail_at, fail_from;
static atomic_int armed;
static int (*real_main)(int, char **, char **);

static int fails(void)
{
    if (!armed)
        return 0;
    unsigned long mine = ++number;
    if (mine != fail_at && !(fail_from && mine >= fail_from))
        return 0;
    errno = ENOMEM;
    return 1;
}

void *malloc(size_t size)
{
    return fails() ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    return fails() ? NULL : __libc_calloc(count, size);
}

void *realloc(void *old, size_t size)
{
    return fails() ? NULL : __libc_realloc(old, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    return fails() ? NULL : __libc_memalign(alignment, size);
}

int posix_memalign(void **out, size_t alignment, size_t size)
{
    *out = fails() ? NULL : __libc_memalign(alignment, size);
    return *out ? 0 : ENOMEM;
}

static void write_count(void)
{
    armed = 0;
    FILE *file = fopen(getenv("FAILMALLOC_COUNT"), "w");
    if (file) {
        fprintf(file, "%lu\n", number);
        fclose(file);
    }
}

static int run(int argc, char **argv, char **environment)
{
    const char *at = getenv("FAILMALLOC_AT"), *from = getenv("FAILMALLOC_FROM");
    fail_at = at ? strtoul(at, NULL, 10) : 0;
    fail_from = from ? strtoul(from, NULL, 10) : 0;
    if (getenv("FAILMALLOC_COUNT"))
        atexit(write_count);
    armed = 1;
    return real_main(argc, argv, environment);
}

int __libc_start_main(int (*program)(int, char **, char **), int argc, char **argv, void (*init)(void),
                      void (*fini)(void), void (*rtld_fini)(void), void *stack_end);

int __libc_start_main(int (*program)(int, char **, char **), int argc, char **argv, void (*init)(void),
                      void (*fini)(void), void (*rtld_fini)(void), void *stack_end)
{
    int (*start)(int (*)(int, char **, char **), int, char **, void (*)(void), void (*)(void), void (*)(void), void *);
    *(void **)&start = dlsym(RTLD_NEXT, "__libc_start_main");
    real_main = program;
    return start(run, argc, argv, init, fini, rtld_fini, stack_end);
}
