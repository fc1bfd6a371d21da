/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include "src/util/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>

struct job {
    void (*body)(void *context, unsigned worker, size_t begin, size_t end);
    void *context;
    size_t count, chunk;
    atomic_size_t next;
    atomic_uint workers;
};

unsigned parallel_cores(void)
{
    cpu_set_t set;
    int cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    return cores < 1 ? 1 : cores < PARALLEL_MAX_THREADS ? (unsigned)cores : PARALLEL_MAX_THREADS;
}

static void *run(void *argument)
{
    struct job *job = argument;
    unsigned worker = atomic_fetch_add(&job->workers, 1);
    for (;;) {
        size_t begin = atomic_fetch_add(&job->next, job->chunk);
        if (begin >= job->count)
            return NULL;
        size_t left = job->count - begin;
        job->body(job->context, worker, begin, begin + (left < job->chunk ? left : job->chunk));
    }
}

void parallel_for(unsigned threads, size_t count, size_t chunk,
                  void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context)
{
    struct job job = {body, context, count, chunk ? chunk : 1, 0, 0};
    pthread_t others[PARALLEL_MAX_THREADS];
    unsigned started = 0, wanted = threads > PARALLEL_MAX_THREADS ? PARALLEL_MAX_THREADS : threads;
    while (started + 1 < wanted && job.chunk * (started + 1) < count &&
           pthread_create(&others[started], NULL, run, &job) == 0)
        started++;
    run(&job);
    while (started)
        pthread_join(others[--started], NULL);
}
