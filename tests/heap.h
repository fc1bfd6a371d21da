/* SPDX-License-Identifier: BSD-3-Clause */
/* The heap of a test that is linked with --wrap for these functions (see the Makefile). Every allocation counts while
 * it
 * lives, and one that moves counts twice meanwhile. */
#ifndef TETLOD_HEAP_H
#define TETLOD_HEAP_H

#include <malloc.h>
#include <string.h>

static size_t now, peak;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void __real_free(void *block);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);
char *__wrap_strdup(const char *text);
void __wrap_free(void *block);

static void *count_in(void *block, size_t replaced)
{
    now += block ? malloc_usable_size(block) : 0;
    peak = now > peak ? now : peak;
    now -= block ? replaced : 0;
    return block;
}

void *__wrap_malloc(size_t size)
{
    return count_in(__real_malloc(size), 0);
}

void *__wrap_calloc(size_t count, size_t size)
{
    return count_in(__real_calloc(count, size), 0);
}

void *__wrap_realloc(void *old, size_t size)
{
    size_t had = old ? malloc_usable_size(old) : 0;
    return count_in(__real_realloc(old, size), had);
}

char *__wrap_strdup(const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = __wrap_malloc(size);
    return copy ? memcpy(copy, text, size) : NULL;
}

void __wrap_free(void *block)
{
    now -= block ? malloc_usable_size(block) : 0;
    __real_free(block);
}

#endif
