/* SPDX-License-Identifier: BSD-3-Clause */
/* Needs POSIX threads. Elsewhere, and in WebAssembly, there are no helpers. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#include "format/common/threads.h"

#include <stddef.h>

#if TETLODI_THREADS
#include <pthread.h>
#include <stdlib.h>

enum { MAX_HELPERS = 255 };

struct tetlodi_helpers {
    pthread_mutex_t mutex;
    pthread_cond_t begun, ended;
    tetlodi_task *task;
    void *context;
    uint32_t next, count, running; /* tasks: not begun from `next` on; begun and not ended */
    int dismissed;
    uint32_t thread_count;
    pthread_t threads[];
};

/* Does tasks as long as there are some. The mutex is held. */
static void work(struct tetlodi_helpers *helpers)
{
    while (helpers->next < helpers->count) {
        uint32_t number = helpers->next++;
        helpers->running++;
        pthread_mutex_unlock(&helpers->mutex);
        int done = helpers->task(helpers->context, number);
        pthread_mutex_lock(&helpers->mutex);
        helpers->running--;
        if (!done)
            helpers->next = helpers->count;
    }
}

static void *help(void *argument)
{
    struct tetlodi_helpers *helpers = argument;
    pthread_mutex_lock(&helpers->mutex);
    while (!helpers->dismissed) {
        work(helpers);
        if (!helpers->running)
            pthread_cond_signal(&helpers->ended);
        pthread_cond_wait(&helpers->begun, &helpers->mutex);
    }
    pthread_mutex_unlock(&helpers->mutex);
    return NULL;
}

struct tetlodi_helpers *tetlodi_helpers_new(uint32_t count)
{
    count = count < MAX_HELPERS ? count : MAX_HELPERS;
    size_t size = sizeof(struct tetlodi_helpers) + count * sizeof(pthread_t);
    struct tetlodi_helpers *helpers = count ? (struct tetlodi_helpers *)calloc(1, size) : NULL;
    if (!helpers)
        return NULL;
    pthread_mutex_init(&helpers->mutex, NULL);
    pthread_cond_init(&helpers->begun, NULL);
    pthread_cond_init(&helpers->ended, NULL);
    while (helpers->thread_count < count &&
           pthread_create(&helpers->threads[helpers->thread_count], NULL, help, helpers) == 0)
        helpers->thread_count++;
    if (helpers->thread_count)
        return helpers;
    tetlodi_helpers_free(helpers);
    return NULL;
}

void tetlodi_helpers_free(struct tetlodi_helpers *helpers)
{
    if (!helpers)
        return;
    pthread_mutex_lock(&helpers->mutex);
    helpers->dismissed = 1;
    pthread_cond_broadcast(&helpers->begun);
    pthread_mutex_unlock(&helpers->mutex);
    for (uint32_t i = 0; i < helpers->thread_count; i++)
        pthread_join(helpers->threads[i], NULL);
    pthread_mutex_destroy(&helpers->mutex);
    pthread_cond_destroy(&helpers->begun);
    pthread_cond_destroy(&helpers->ended);
    free(helpers);
}

void tetlodi_helpers_start(struct tetlodi_helpers *helpers, tetlodi_task *task, void *context, uint32_t count)
{
    if (!helpers) {
        for (uint32_t i = 0; i < count && task(context, i); i++)
            continue;
        return;
    }
    pthread_mutex_lock(&helpers->mutex);
    helpers->task = task;
    helpers->context = context;
    helpers->next = 0;
    helpers->count = count;
    pthread_cond_broadcast(&helpers->begun);
    pthread_mutex_unlock(&helpers->mutex);
}

void tetlodi_helpers_wait(struct tetlodi_helpers *helpers)
{
    if (!helpers)
        return;
    pthread_mutex_lock(&helpers->mutex);
    work(helpers);
    while (helpers->running)
        pthread_cond_wait(&helpers->ended, &helpers->mutex);
    pthread_mutex_unlock(&helpers->mutex);
}

#else

struct tetlodi_helpers *tetlodi_helpers_new(uint32_t count)
{
    (void)count;
    return NULL;
}

void tetlodi_helpers_free(struct tetlodi_helpers *helpers)
{
    (void)helpers;
}

void tetlodi_helpers_start(struct tetlodi_helpers *helpers, tetlodi_task *task, void *context, uint32_t count)
{
    (void)helpers;
    for (uint32_t i = 0; i < count && task(context, i); i++)
        continue;
}

void tetlodi_helpers_wait(struct tetlodi_helpers *helpers)
{
    (void)helpers;
}

#endif
