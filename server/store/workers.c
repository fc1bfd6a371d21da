/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/workers.h"

#include <pthread.h>
#include <stdlib.h>
#include <sys/resource.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/clock.h"

enum {
    MAX_EXTRA = 64, /* threads beside those that were asked for, while files hang */
};

struct task {
    void (*work)(void *context);
    void *context;
};

struct workers {
    pthread_mutex_t lock;
    pthread_cond_t changed, all_ended;
    bool stopping;
    struct task *ring;
    size_t capacity, first, count;
    unsigned wanted, threads, working, ended;
    pthread_t *ids; /* [wanted + MAX_EXTRA], of which `threads` run */
};

/* Below the threads that answer: what is there already shall not wait for what is being made. (On Linux this is the
 * calling thread's alone.) */
static void step_back(void)
{
    setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + 5); // where it is not allowed, they are equals
}

static void *run(void *argument)
{
    struct workers *workers = argument;
    step_back();
    pthread_mutex_lock(&workers->lock);
    for (;;) {
        while (!workers->count && !workers->stopping)
            pthread_cond_wait(&workers->changed, &workers->lock);
        if (!workers->count)
            break;
        struct task task = workers->ring[workers->first];
        workers->first = (workers->first + 1) % workers->capacity;
        workers->count--;
        workers->working++;
        pthread_mutex_unlock(&workers->lock);
        task.work(task.context);
        pthread_mutex_lock(&workers->lock);
        workers->working--;
    }
    workers->ended++;
    pthread_cond_broadcast(&workers->all_ended);
    pthread_mutex_unlock(&workers->lock);
    return NULL;
}

/* False: there can be no more. Called with the lock, or before there is another thread. */
static bool add_thread(struct workers *workers)
{
    bool added = workers->threads < workers->wanted + MAX_EXTRA && pthread_create(&workers->ids[workers->threads],
                                                                                  NULL, run,
                                                                            workers) == 0;
    workers->threads += added;
    return added;
}

enum tetlod_status workers_start(struct workers **out, unsigned threads, size_t capacity, struct tetlod_error *error)
{
    *out = NULL;
    struct workers *workers = array_zero(1, sizeof *workers);
    if (!workers)
        return tetlodi_fail_nomem(error, "the worker threads", sizeof *workers);
    workers->ring = array_new(capacity, sizeof *workers->ring);
    workers->ids = array_new(threads + MAX_EXTRA, sizeof *workers->ids);
    workers->capacity = capacity;
    workers->wanted = threads;
    pthread_mutex_init(&workers->lock, NULL);
    pthread_cond_init(&workers->changed, NULL);
    monotonic_cond_init(&workers->all_ended);
    while (workers->ring && workers->ids && workers->threads < threads && add_thread(workers))
        ;
    if (workers->threads) { // fewer threads than asked for are slower, not wrong
        *out = workers;
        return TETLOD_OK;
    }
    workers_free(workers);
    return tetlodi_fail(error, TETLOD_ERR_NOMEM, "cannot start worker threads");
}

void workers_relieve(struct workers *workers, size_t lost)
{
    pthread_mutex_lock(&workers->lock);
    while (workers->count && !workers->stopping && workers->threads < workers->wanted + lost && add_thread(workers))
        ;
    pthread_mutex_unlock(&workers->lock);
}

bool workers_submit(struct workers *workers, void (*work)(void *context), void *context)
{
    pthread_mutex_lock(&workers->lock);
    bool room = workers->count < workers->capacity && !workers->stopping;
    if (room) {
        workers->ring[(workers->first + workers->count) % workers->capacity] = (struct task){work, context};
        workers->count++;
        pthread_cond_signal(&workers->changed);
    }
    pthread_mutex_unlock(&workers->lock);
    return room;
}

bool workers_stopping(struct workers *workers)
{
    pthread_mutex_lock(&workers->lock);
    bool stopping = workers->stopping;
    pthread_mutex_unlock(&workers->lock);
    return stopping;
}

void workers_count(struct workers *workers, size_t *out_queued, size_t *out_working)
{
    pthread_mutex_lock(&workers->lock);
    *out_queued = workers->count;
    *out_working = workers->working;
    pthread_mutex_unlock(&workers->lock);
}

void workers_cancel(struct workers *workers)
{
    if (!workers)
        return;
    pthread_mutex_lock(&workers->lock);
    workers->stopping = true;
    pthread_cond_broadcast(&workers->changed);
    pthread_mutex_unlock(&workers->lock);
}

bool workers_stop(struct workers *workers, double until)
{
    if (!workers)
        return true;
    workers_cancel(workers);
    pthread_mutex_lock(&workers->lock);
    bool in_time = true;
    while (workers->ended < workers->threads && in_time)
        in_time = monotonic_cond_wait(&workers->all_ended, &workers->lock, until);
    bool ended = workers->ended == workers->threads;
    pthread_mutex_unlock(&workers->lock);
    for (unsigned i = 0; ended && i < workers->threads; i++)
        pthread_join(workers->ids[i], NULL);
    return ended;
}

void workers_free(struct workers *workers)
{
    if (!workers)
        return;
    pthread_cond_destroy(&workers->changed);
    pthread_cond_destroy(&workers->all_ended);
    pthread_mutex_destroy(&workers->lock);
    free(workers->ring);
    free(workers->ids);
    free(workers);
}
