/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_CLOCK_H
#define TETLOD_CLOCK_H

#include <pthread.h>
#include <stdbool.h>

/* Seconds of a clock that only goes forward. */
double monotonic_seconds(void);

/* Processor seconds of the calling thread. */
double thread_seconds(void);

/* Waits for less than a second. Timers that look after their thread (SIGPROF) do not wake it. */
void sleep_through(double seconds);

/* A condition whose waits end by that clock. */
void monotonic_cond_init(pthread_cond_t *condition);

/* Waits for a signal, or until that clock shows `until` at most; as for all conditions it may be woken for nothing.
 * False: it is that late. */
bool monotonic_cond_wait(pthread_cond_t *condition, pthread_mutex_t *lock, double until);

#endif
