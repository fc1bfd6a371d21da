/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/clock.h"

#include <errno.h>
#include <signal.h>
#include <time.h>

double thread_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double monotonic_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

void sleep_through(double seconds)
{
    sigset_t timers, before;
    sigemptyset(&timers);
    sigaddset(&timers, SIGPROF);
    pthread_sigmask(SIG_BLOCK, &timers, &before);
    nanosleep(&(struct timespec){.tv_nsec = (long)(seconds * 1e9)}, NULL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

void monotonic_cond_init(pthread_cond_t *condition)
{
    pthread_condattr_t attributes;
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(condition, &attributes);
    pthread_condattr_destroy(&attributes);
}

bool monotonic_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock, double until)
{
    struct timespec time = {.tv_sec = (time_t)until};
    time.tv_nsec = (long)((until - (double)time.tv_sec) * 1e9);
    return pthread_cond_timedwait(condition, lock, &time) != ETIMEDOUT;
}
