/* SPDX-License-Identifier: BSD-3-Clause */
/* Needs POSIX threads. Elsewhere, and in WebAssembly, there are no helpers. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#include "format/common/threads.h"

#include <stddef.h>

/* What there is to do, by the caller alone. */
static int do_alone(tetlodi_task *task, tetlodi_task *commit, void *context, uint32_t count)
{
    int good = 1;
    for (uint32_t i = 0; i < count && good; i++) {
        good = task(context, i);
        good = commit ? commit(context, i) : good;
    }
    return good;
}

#if TETLODI_THREADS
#include <pthread.h>
#include <stdlib.h>

enum { MAX_HELPERS = 255, MAX_AHEAD = 64 };

struct tetlodi_helpers {
    pthread_mutex_t mutex;
    pthread_cond_t begun, ended;
    tetlodi_task *task;
    void *context;
    uint32_t next, count, running; /* tasks: not begun from `next` on; begun and not ended */
    uint32_t committed, ahead;     /* of these fewer than `ahead` are begun and not committed */
    uint64_t done;                 /* bit i % MAX_AHEAD: task i has ended and is not committed */
    int dismissed;
    uint32_t thread_count;
    pthread_t threads[];
};

/* Does the next task, if it may begin. The mutex is held. */
static int do_one(struct tetlodi_helpers *helpers)
{
    if (helpers->next >= helpers->count || helpers->next - helpers->committed >= helpers->ahead)
        return 0;
    uint32_t number = helpers->next++;
    helpers->running++;
    pthread_mutex_unlock(&helpers->mutex);
    int done = helpers->task(helpers->context, number);
    pthread_mutex_lock(&helpers->mutex);
    helpers->running--;
    helpers->done |= UINT64_C(1) << number % MAX_AHEAD;
    if (!done)
        helpers->next = helpers->count;
    return 1;
}

static void *help(void *argument)
{
    struct tetlodi_helpers *helpers = argument;
    pthread_mutex_lock(&helpers->mutex);
    while (!helpers->dismissed) {
        while (do_one(helpers))
            if (helpers->ahead < UINT32_MAX)
                pthread_cond_signal(&helpers->ended);
        if (!helpers->running)
            pthread_cond_signal(&helpers->ended);
        if (!helpers->dismissed) // while it had a task: nobody would call it again
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
    helpers->next = helpers->count; // of what was begun nobody waits for the rest
    pthread_cond_broadcast(&helpers->begun);
    pthread_mutex_unlock(&helpers->mutex);
    for (uint32_t i = 0; i < helpers->thread_count; i++)
        pthread_join(helpers->threads[i], NULL);
    pthread_mutex_destroy(&helpers->mutex);
    pthread_cond_destroy(&helpers->begun);
    pthread_cond_destroy(&helpers->ended);
    free(helpers);
}

/* The mutex is held. */
static void begin(struct tetlodi_helpers *helpers, tetlodi_task *task, void *context, uint32_t count, uint32_t ahead)
{
    helpers->task = task;
    helpers->context = context;
    helpers->next = helpers->committed = 0;
    helpers->count = count;
    helpers->ahead = ahead;
    helpers->done = 0;
    pthread_cond_broadcast(&helpers->begun);
}

void tetlodi_helpers_start(struct tetlodi_helpers *helpers, tetlodi_task *task, void *context, uint32_t count)
{
    if (!helpers) {
        do_alone(task, NULL, context, count);
        return;
    }
    pthread_mutex_lock(&helpers->mutex);
    begin(helpers, task, context, count, UINT32_MAX);
    pthread_mutex_unlock(&helpers->mutex);
}

/* The mutex is held. */
static void await_running(struct tetlodi_helpers *helpers)
{
    while (helpers->running)
        pthread_cond_wait(&helpers->ended, &helpers->mutex);
}

void tetlodi_helpers_wait(struct tetlodi_helpers *helpers)
{
    if (!helpers)
        return;
    pthread_mutex_lock(&helpers->mutex);
    while (do_one(helpers))
        continue;
    await_running(helpers);
    pthread_mutex_unlock(&helpers->mutex);
}

/* Commits the next task, if it has ended, and lets more begin. The mutex is held. */
static int commit_one(struct tetlodi_helpers *helpers, tetlodi_task *commit, int *io_good)
{
    uint64_t bit = UINT64_C(1) << helpers->committed % MAX_AHEAD;
    if (!(helpers->done & bit))
        return 0;
    pthread_mutex_unlock(&helpers->mutex);
    *io_good = commit(helpers->context, helpers->committed);
    pthread_mutex_lock(&helpers->mutex);
    helpers->done &= ~bit;
    helpers->committed++;
    pthread_cond_broadcast(&helpers->begun);
    return 1;
}

int tetlodi_helpers_in_order(struct tetlodi_helpers *helpers, tetlodi_task *task, tetlodi_task *commit, void *context,
                             uint32_t count)
{
    int good = 1;
    if (!helpers)
        return do_alone(task, commit, context, count);
    pthread_mutex_lock(&helpers->mutex);
    uint32_t ahead = 2 * (helpers->thread_count + 1);
    begin(helpers, task, context, count, ahead < MAX_AHEAD ? ahead : MAX_AHEAD);
    while (good && helpers->committed < count)
        if (!commit_one(helpers, commit, &good) && !do_one(helpers))
            pthread_cond_wait(&helpers->ended, &helpers->mutex);
    helpers->next = helpers->count;
    await_running(helpers);
    pthread_mutex_unlock(&helpers->mutex);
    return good;
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
    do_alone(task, NULL, context, count);
}

void tetlodi_helpers_wait(struct tetlodi_helpers *helpers)
{
    (void)helpers;
}

int tetlodi_helpers_in_order(struct tetlodi_helpers *helpers, tetlodi_task *task, tetlodi_task *commit, void *context,
                             uint32_t count)
{
    (void)helpers;
    return do_alone(task, commit, context, count);
}

#endif
