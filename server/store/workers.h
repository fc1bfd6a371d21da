/* SPDX-License-Identifier: BSD-3-Clause */
/* Threads that take work from one bounded queue: what takes longer than a request may hold a connection's thread. */
#ifndef TETLOD_SERVER_WORKERS_H
#define TETLOD_SERVER_WORKERS_H

#include <stdbool.h>

#include "format/tetlod.h"

struct workers;

TETLOD_CHECKED enum tetlod_status workers_start(struct workers **out, unsigned threads, size_t capacity,
                                             struct tetlod_error *error);

/* False if the queue is full or the workers stopped; then nothing was taken. */
bool workers_submit(struct workers *workers, void (*work)(void *context), void *context);

/* Takes nothing from now on. What is queued still runs, but sees that it should give up. */
void workers_cancel(struct workers *workers);

/* Whether workers_cancel was called: work should give up. */
bool workers_stopping(struct workers *workers);

/* Starts threads in the place of those that are lost, which are at most so many, as long as there is work for them. */
void workers_relieve(struct workers *workers, size_t lost);

/* How much is queued, and is being worked on. */
void workers_count(struct workers *workers, size_t *out_queued, size_t *out_working);

/* Cancels, and ends the threads by this time of the monotonic clock. False: some of them still work, and nothing may be
 * freed that they use. Once. */
bool workers_stop(struct workers *workers, double until);
void workers_free(struct workers *workers);

#endif
