/* SPDX-License-Identifier: BSD-3-Clause */
/* Threads that take work from one bounded queue: what takes longer than a request may hold a connection's thread. */
#ifndef TETLOD_SERVER_POOL_H
#define TETLOD_SERVER_POOL_H

#include <stdbool.h>

#include "format/tetlod.h"

struct pool;

TETLOD_CHECKED enum tetlod_status pool_start(struct pool **out, unsigned threads, size_t capacity,
                                             struct tetlod_error *error);

/* False if the queue is full or the pool stopped; then nothing was taken. */
bool pool_submit(struct pool *pool, void (*work)(void *context), void *context);

/* Takes nothing from now on. What is queued still runs, but sees that it should give up. */
void pool_cancel(struct pool *pool);

/* Whether pool_cancel was called: work should give up. */
bool pool_stopping(struct pool *pool);

/* Starts threads in the place of those that are lost, which are at most so many, as long as there is work for them. */
void pool_relieve(struct pool *pool, size_t lost);

/* How much is queued, and is being worked on. */
void pool_count(struct pool *pool, size_t *out_queued, size_t *out_working);

/* Cancels, and ends the threads by this time of the monotonic clock. False: some of them still work, and nothing may be
 * freed that they use. Once. */
bool pool_stop(struct pool *pool, double until);
void pool_free(struct pool *pool);

#endif
