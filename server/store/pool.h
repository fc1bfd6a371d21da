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

/* Whether pool_stop was called: work that waits for something should give up. */
bool pool_stopping(struct pool *pool);

/* Starts threads in the place of those that are lost, which are at most so many, as long as there is work for them. */
void pool_relieve(struct pool *pool, size_t lost);

/* Runs what is queued to its end, then ends the threads; from then on nothing is taken. Once. False if a thread does not end, and
 * give_up, which is asked now and then, says so: then nothing that its work uses may be freed. */
bool pool_stop(struct pool *pool, bool (*give_up)(void *opaque), void *opaque);
void pool_free(struct pool *pool);

#endif
