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

/* Runs what is queued to its end, then ends the threads; from then on nothing is taken. Once. */
void pool_stop(struct pool *pool);
void pool_free(struct pool *pool);

#endif
