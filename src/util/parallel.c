/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include "src/util/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>

enum { MOST_THREADS = 64 };

struct job {
    void (*body)(void *context, size_t begin, size_t end);
    void *context;
    size_t count, chunk;
    atomic_size_t next;
};

unsigned parallel_cores(void)
{
    cpu_set_t set;
    int cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    return cores > 0 ? (unsigned)cores : 1;
}

static void *run(void *argument)
{
    struct job *job = argument;
    for (;;) {
        size_t begin = atomic_fetch_add(&job->next, job->chunk);
        if (begin >= job->count)
            return NULL;
        size_t left = job->count - begin;
        job->body(job->context, begin, begin + (left < job->chunk ? left : job->chunk));
    }
}

void parallel_for(unsigned threads, size_t count, size_t chunk, void (*body)(void *context, size_t begin, size_t end),
                  void *context)
{
    struct job job = {body, context, count, chunk ? chunk : 1, 0};
    pthread_t others[MOST_THREADS];
    unsigned started = 0, wanted = threads > MOST_THREADS ? MOST_THREADS : threads;
    while (started + 1 < wanted && pthread_create(&others[started], NULL, run, &job) == 0)
        started++;
    run(&job);
    while (started)
        pthread_join(others[--started], NULL);
}
