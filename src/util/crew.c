/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/crew.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>

#include "src/util/clock.h"
#include "src/util/parallel.h"

/* Seconds that a thread looks for what it waits for before it goes to sleep. To be woken takes long where the processor
 * sleeps, too: longer than most jobs of a round, and than what is done between two of them. Where other programs hold
 * up what is waited for, looking takes time from them and from it: after each wait that was longer the patience is
 * halved. */
static const double MAX_PATIENCE = 400e-6, MIN_PATIENCE = 10e-6;

struct crew {
    unsigned size;
    pthread_t threads[PARALLEL_MAX_THREADS];
    pthread_mutex_t mutex;
    pthread_cond_t called, finished;
    atomic_uint call;    /* counts the jobs */
    atomic_uint working; /* threads that have not finished the job */
    double patience;     /* of the one that calls */
    bool dismissed;
    void (*body)(void *context, unsigned worker, size_t begin, size_t end);
    void *context;
    size_t count, chunk;
    atomic_size_t next;
};

struct recruit {
    struct crew *crew;
    unsigned worker;
};

static void work(struct crew *crew, unsigned worker)
{
    for (;;) {
        size_t begin = atomic_fetch_add_explicit(&crew->next, crew->chunk, memory_order_relaxed);
        if (begin >= crew->count)
            return;
        size_t left = crew->count - begin;
        crew->body(crew->context, worker, begin, begin + (left < crew->chunk ? left : crew->chunk));
    }
}

/* Waits for a while. Is it (if `not` is false) or is it not that number in the end? */
static bool comes_to(const atomic_uint *value, unsigned number, bool not, double until)
{
    do
        if ((atomic_load_explicit(value, memory_order_acquire) == number) != not)
            return true;
    while (monotonic_seconds() < until); // which takes so long that the other thread is not held up
    return false;
}

static double patience_after(double patience, double waited)
{
    if (waited < MAX_PATIENCE)
        return MAX_PATIENCE;
    return patience / 2 > MIN_PATIENCE ? patience / 2 : MIN_PATIENCE;
}

static void *serve(void *argument)
{
    struct recruit recruit = *(struct recruit *)argument;
    struct crew *crew = recruit.crew;
    double patience = MAX_PATIENCE;
    free(argument);
    for (unsigned seen = 0;; seen++) {
        double begun = monotonic_seconds();
        if (!comes_to(&crew->call, seen, true, begun + patience)) {
            pthread_mutex_lock(&crew->mutex);
            while (atomic_load(&crew->call) == seen)
                pthread_cond_wait(&crew->called, &crew->mutex);
            pthread_mutex_unlock(&crew->mutex);
        }
        if (crew->dismissed)
            return NULL;
        patience = patience_after(patience, monotonic_seconds() - begun);
        work(crew, recruit.worker);
        if (atomic_fetch_sub(&crew->working, 1) == 1) {
            pthread_mutex_lock(&crew->mutex);
            pthread_cond_signal(&crew->finished);
            pthread_mutex_unlock(&crew->mutex);
        }
    }
}

struct crew *crew_new(unsigned threads)
{
    struct crew *crew = calloc(1, sizeof *crew);
    if (!crew)
        return NULL;
    crew->patience = MAX_PATIENCE;
    pthread_mutex_init(&crew->mutex, NULL);
    pthread_cond_init(&crew->called, NULL);
    pthread_cond_init(&crew->finished, NULL);
    threads = threads < PARALLEL_MAX_THREADS ? threads : PARALLEL_MAX_THREADS;
    for (crew->size = 1; crew->size < threads; crew->size++) {
        struct recruit *recruit = malloc(sizeof *recruit);
        if (recruit)
            *recruit = (struct recruit){crew, crew->size};
        if (!recruit || pthread_create(&crew->threads[crew->size], NULL, serve, recruit) != 0) {
            free(recruit);
            break;
        }
    }
    return crew;
}

static void call(struct crew *crew)
{
    pthread_mutex_lock(&crew->mutex);
    atomic_store(&crew->working, crew->size - 1);
    atomic_fetch_add(&crew->call, 1);
    pthread_cond_broadcast(&crew->called);
    pthread_mutex_unlock(&crew->mutex);
}

void crew_free(struct crew *crew)
{
    if (!crew)
        return;
    crew->dismissed = true;
    call(crew);
    for (unsigned i = 1; i < crew->size; i++)
        pthread_join(crew->threads[i], NULL);
    pthread_mutex_destroy(&crew->mutex);
    pthread_cond_destroy(&crew->called);
    pthread_cond_destroy(&crew->finished);
    free(crew);
}

unsigned crew_size(const struct crew *crew)
{
    return crew->size;
}

/* Until the others have finished, too. */
static void await_others(struct crew *crew)
{
    double begun = monotonic_seconds();
    if (!comes_to(&crew->working, 0, false, begun + crew->patience)) {
        pthread_mutex_lock(&crew->mutex);
        while (atomic_load(&crew->working))
            pthread_cond_wait(&crew->finished, &crew->mutex);
        pthread_mutex_unlock(&crew->mutex);
    }
    crew->patience = patience_after(crew->patience, monotonic_seconds() - begun);
}

void crew_run(struct crew *crew, size_t count, size_t chunk,
              void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context)
{
    if (!count)
        return;
    if (crew->size == 1 || count <= chunk) {
        body(context, 0, 0, count);
        return;
    }
    crew->body = body;
    crew->context = context;
    crew->count = count;
    crew->chunk = chunk;
    atomic_store(&crew->next, 0);
    call(crew);
    work(crew, 0);
    await_others(crew);
}
