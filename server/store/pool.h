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

/* Tells the pool whose thread calls that it begins or ends to read a file, which may hang: on a network's file system for good. */
void pool_reading(bool begins);

/* Starts threads in the place of those that hang, as long as there is work for them; to be called now and then. How many hang. */
unsigned pool_relieve(struct pool *pool);

/* Runs what is queued to its end, then ends the threads; from then on nothing is taken. Once. False if after so many seconds a
 * thread hangs: then nothing that its work uses may be freed. */
bool pool_stop(struct pool *pool, double patience);
void pool_free(struct pool *pool);

#endif
