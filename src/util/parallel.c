/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include "src/util/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>

#include "src/util/clock.h"

/* Seconds that a thread looks for what it waits for before it goes to sleep. To be woken takes long where the processor
 * sleeps, too: longer than most jobs of a round, and than what is done between two of them. Where other programs hold
 * up what is waited for, looking takes time from them and from it: after each longer wait the time is halved. */
static const double MAX_SPIN = 400e-6, MIN_SPIN = 10e-6;

/* A thread may look for no longer in all than this share of the time that it has worked: where jobs are so small that
 * their caller does nearly all of it, the others sleep. */
static const double SPIN_SHARE = 0.25;

/* Where others take the processor away from one thread, all wait for it, and one alone may be faster. So what threads
 * gain is counted, up to MAX_GAINED seconds; once they have lost MAX_LOST in all, the caller works alone for ALONE
 * times that, and then they are tried again. Jobs of which the caller does more than LONG are no rounds: a wait is
 * little. */
static const double MAX_GAINED = 5e-3, MAX_LOST = 1e-3, ALONE = 20, LONG = 20e-3;

/* What a thread has worked and what it has looked, in seconds. */
struct account {
    double worked, looked;
};

struct job {
    void (*body)(void *context, unsigned worker, size_t begin, size_t end);
    void *context;
    size_t count, chunk;
};

struct pool {
    unsigned size;
    pthread_t threads[PARALLEL_MAX_THREADS];
    pthread_mutex_t mutex;
    pthread_cond_t called, finished;
    atomic_uint numbered; /* threads that have their number */
    atomic_uint call;     /* counts the jobs */
    atomic_bool open;     /* a thread may begin with the job */
    atomic_uint working;  /* threads that may have begun with it: nobody waits for one that comes late */
    double spin; /* of the one that calls */
    struct account account;
    double gained, alone; /* seconds that the threads have, and for which the caller works alone */
    atomic_bool dismissed;
    struct job job;
    atomic_size_t next;
};

unsigned parallel_cores(void)
{
    cpu_set_t set;
    int cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    return cores < 1 ? 1 : cores < PARALLEL_MAX_THREADS ? (unsigned)cores : PARALLEL_MAX_THREADS;
}

/* Returns how much of the job it did. */
static size_t work(struct pool *pool, unsigned worker)
{
    const struct job *job = &pool->job;
    for (size_t done = 0;;) {
        size_t begin = atomic_fetch_add_explicit(&pool->next, job->chunk, memory_order_relaxed);
        if (begin >= job->count)
            return done;
        size_t left = job->count - begin, count = left < job->chunk ? left : job->chunk;
        job->body(job->context, worker, begin, begin + count);
        done += count;
    }
}

/* Waits until then at most. Is it (if `not` is false) or is it not that number in the end? */
static bool comes_to(const atomic_uint *value, unsigned number, bool not, double until)
{
    do
        if ((atomic_load_explicit(value, memory_order_acquire) == number) != not)
            return true;
    while (monotonic_seconds() < until); // which takes so long that the other thread is not held up
    return false;
}

/* How long a thread may look for what it waits for. */
static double spin_within(const struct account *account, double spin)
{
    double left = SPIN_SHARE * account->worked - account->looked;
    return left < spin ? left : spin;
}

static double spin_after(double spin, double waited)
{
    if (waited < MAX_SPIN)
        return MAX_SPIN;
    return spin / 2 > MIN_SPIN ? spin / 2 : MIN_SPIN;
}

/* Works on what is open, if anything is: then the caller waits. */
static void help(struct pool *pool, unsigned worker)
{
    atomic_fetch_add(&pool->working, 1);
    if (atomic_load(&pool->open))
        work(pool, worker);
    if (atomic_fetch_sub(&pool->working, 1) == 1 && !atomic_load(&pool->open)) {
        pthread_mutex_lock(&pool->mutex);
        pthread_cond_signal(&pool->finished);
        pthread_mutex_unlock(&pool->mutex);
    }
}

static void *serve(void *argument)
{
    struct pool *pool = argument;
    const unsigned worker = 1 + atomic_fetch_add(&pool->numbered, 1);
    struct account account = {0};
    double spin = MAX_SPIN;
    for (unsigned seen = 0;;) {
        double begun = monotonic_seconds();
        bool came = comes_to(&pool->call, seen, true, begun + spin_within(&account, spin));
        account.looked += monotonic_seconds() - begun;
        if (!came) {
            pthread_mutex_lock(&pool->mutex);
            while (atomic_load(&pool->call) == seen)
                pthread_cond_wait(&pool->called, &pool->mutex);
            pthread_mutex_unlock(&pool->mutex);
        }
        seen = atomic_load(&pool->call);
        if (atomic_load(&pool->dismissed))
            return NULL;
        double called = monotonic_seconds();
        spin = spin_after(spin, called - begun);
        help(pool, worker);
        account.worked += monotonic_seconds() - called;
    }
}

struct pool *pool_new(unsigned threads)
{
    struct pool *pool = calloc(1, sizeof *pool);
    if (!pool)
        return NULL;
    pool->spin = MAX_SPIN;
    pthread_mutex_init(&pool->mutex, NULL);
    pthread_cond_init(&pool->called, NULL);
    pthread_cond_init(&pool->finished, NULL);
    threads = threads < PARALLEL_MAX_THREADS ? threads : PARALLEL_MAX_THREADS;
    pool->size = 1;
    while (pool->size < threads && pthread_create(&pool->threads[pool->size], NULL, serve, pool) == 0)
        pool->size++;
    return pool;
}

static void call(struct pool *pool)
{
    pthread_mutex_lock(&pool->mutex);
    atomic_fetch_add(&pool->call, 1);
    pthread_cond_broadcast(&pool->called);
    pthread_mutex_unlock(&pool->mutex);
}

void pool_free(struct pool *pool)
{
    if (!pool)
        return;
    atomic_store(&pool->dismissed, true);
    call(pool);
    for (unsigned i = 1; i < pool->size; i++)
        pthread_join(pool->threads[i], NULL);
    pthread_mutex_destroy(&pool->mutex);
    pthread_cond_destroy(&pool->called);
    pthread_cond_destroy(&pool->finished);
    free(pool);
}

unsigned pool_size(const struct pool *pool)
{
    return pool->size;
}

/* Until those who have begun have finished, too. */
static void await_others(struct pool *pool)
{
    double begun = monotonic_seconds();
    atomic_store(&pool->open, false);
    bool came = comes_to(&pool->working, 0, false, begun + spin_within(&pool->account, pool->spin));
    pool->account.looked += monotonic_seconds() - begun;
    if (!came) {
        pthread_mutex_lock(&pool->mutex);
        while (atomic_load(&pool->working))
            pthread_cond_wait(&pool->finished, &pool->mutex);
        pthread_mutex_unlock(&pool->mutex);
    }
    pool->spin = spin_after(pool->spin, monotonic_seconds() - begun);
}

/* The caller alone would have taken `alone` seconds for a job, and took `taken`. */
static void count_gain(struct pool *pool, double alone, double taken)
{
    double gained = pool->gained + alone - taken;
    bool lost = gained < -MAX_LOST;
    pool->alone = lost ? -ALONE * gained : 0;
    pool->gained = lost ? 0 : gained < MAX_GAINED ? gained : MAX_GAINED;
}

static void run_together(struct pool *pool)
{
    double begun = monotonic_seconds(), begun_own = thread_seconds();
    atomic_store(&pool->open, true);
    call(pool);
    size_t done = work(pool, 0);
    double worked = thread_seconds() - begun_own;
    pool->account.worked += worked;
    await_others(pool);
    if (done && worked < LONG)
        count_gain(pool, worked * ((double)pool->job.count / (double)done), monotonic_seconds() - begun);
}

static void run_alone(struct pool *pool)
{
    double begun = monotonic_seconds();
    work(pool, 0);
    pool->alone -= monotonic_seconds() - begun;
}

static void run_all(struct pool *pool, const struct job *job)
{
    pool->job = *job;
    atomic_store(&pool->next, 0);
    if (pool->size > 1 && pool->alone <= 0)
        run_together(pool);
    else
        run_alone(pool);
}

void pool_run(struct pool *pool, size_t count, size_t chunk,
              void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context)
{
    if (!count)
        return;
    if (pool->size == 1 || count <= chunk)
        body(context, 0, 0, count);
    else
        run_all(pool, &(struct job){body, context, count, chunk});
}

void parallel_for(unsigned threads, size_t count, size_t chunk,
                  void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context)
{
    const struct job job = {body, context, count, chunk ? chunk : 1};
    const size_t chunks = count / job.chunk + (count % job.chunk != 0);
    struct pool alone = {.size = 1}, *pool = threads > 1 && chunks > 1 ? pool_new(chunks < threads ? (unsigned)chunks
                                                                                  : threads) : NULL;
    run_all(pool ? pool : &alone, &job);
    pool_free(pool);
}
