/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/pool.h"

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

struct pool {
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
    struct pool *pool = argument;
    step_back();
    pthread_mutex_lock(&pool->lock);
    for (;;) {
        while (!pool->count && !pool->stopping)
            pthread_cond_wait(&pool->changed, &pool->lock);
        if (!pool->count)
            break;
        struct task task = pool->ring[pool->first];
        pool->first = (pool->first + 1) % pool->capacity;
        pool->count--;
        pool->working++;
        pthread_mutex_unlock(&pool->lock);
        task.work(task.context);
        pthread_mutex_lock(&pool->lock);
        pool->working--;
    }
    pool->ended++;
    pthread_cond_broadcast(&pool->all_ended);
    pthread_mutex_unlock(&pool->lock);
    return NULL;
}

/* False: there can be no more. Called with the lock, or before there is another thread. */
static bool add_thread(struct pool *pool)
{
    bool added = pool->threads < pool->wanted + MAX_EXTRA && pthread_create(&pool->ids[pool->threads], NULL, run,
                                                                            pool) == 0;
    pool->threads += added;
    return added;
}

enum tetlod_status pool_start(struct pool **out, unsigned threads, size_t capacity, struct tetlod_error *error)
{
    *out = NULL;
    struct pool *pool = array_zero(1, sizeof *pool);
    if (!pool)
        return tetlodi_fail_nomem(error, "the worker threads", sizeof *pool);
    pool->ring = array_new(capacity, sizeof *pool->ring);
    pool->ids = array_new(threads + MAX_EXTRA, sizeof *pool->ids);
    pool->capacity = capacity;
    pool->wanted = threads;
    pthread_mutex_init(&pool->lock, NULL);
    pthread_cond_init(&pool->changed, NULL);
    monotonic_cond_init(&pool->all_ended);
    while (pool->ring && pool->ids && pool->threads < threads && add_thread(pool))
        ;
    if (pool->threads) { // fewer threads than asked for are slower, not wrong
        *out = pool;
        return TETLOD_OK;
    }
    pool_free(pool);
    return tetlodi_fail(error, TETLOD_ERR_NOMEM, "cannot start worker threads");
}

void pool_relieve(struct pool *pool, size_t lost)
{
    pthread_mutex_lock(&pool->lock);
    while (pool->count && !pool->stopping && pool->threads < pool->wanted + lost && add_thread(pool))
        ;
    pthread_mutex_unlock(&pool->lock);
}

bool pool_submit(struct pool *pool, void (*work)(void *context), void *context)
{
    pthread_mutex_lock(&pool->lock);
    bool room = pool->count < pool->capacity && !pool->stopping;
    if (room) {
        pool->ring[(pool->first + pool->count) % pool->capacity] = (struct task){work, context};
        pool->count++;
        pthread_cond_signal(&pool->changed);
    }
    pthread_mutex_unlock(&pool->lock);
    return room;
}

bool pool_stopping(struct pool *pool)
{
    pthread_mutex_lock(&pool->lock);
    bool stopping = pool->stopping;
    pthread_mutex_unlock(&pool->lock);
    return stopping;
}

void pool_count(struct pool *pool, size_t *out_queued, size_t *out_working)
{
    pthread_mutex_lock(&pool->lock);
    *out_queued = pool->count;
    *out_working = pool->working;
    pthread_mutex_unlock(&pool->lock);
}

void pool_cancel(struct pool *pool)
{
    if (!pool)
        return;
    pthread_mutex_lock(&pool->lock);
    pool->stopping = true;
    pthread_cond_broadcast(&pool->changed);
    pthread_mutex_unlock(&pool->lock);
}

bool pool_stop(struct pool *pool, double until)
{
    if (!pool)
        return true;
    pool_cancel(pool);
    pthread_mutex_lock(&pool->lock);
    bool in_time = true;
    while (pool->ended < pool->threads && in_time)
        in_time = monotonic_cond_wait(&pool->all_ended, &pool->lock, until);
    bool ended = pool->ended == pool->threads;
    pthread_mutex_unlock(&pool->lock);
    for (unsigned i = 0; ended && i < pool->threads; i++)
        pthread_join(pool->ids[i], NULL);
    return ended;
}

void pool_free(struct pool *pool)
{
    if (!pool)
        return;
    pthread_cond_destroy(&pool->changed);
    pthread_cond_destroy(&pool->all_ended);
    pthread_mutex_destroy(&pool->lock);
    free(pool->ring);
    free(pool->ids);
    free(pool);
}
