/* SPDX-License-Identifier: BSD-3-Clause */
/* Work on ranges by several threads. What a range computes must not depend on how the whole was cut. */
#ifndef TETLOD_PARALLEL_H
#define TETLOD_PARALLEL_H

#include <stddef.h>

/* Cores that this process may use, at least 1. */
unsigned parallel_cores(void);

enum { PARALLEL_MAX_THREADS = 64 };

/* Calls body(context, worker, begin, end) until chunks of at most `chunk` have covered 0 .. count, on `threads` threads
 * (the caller's included). `worker` is the thread's number below min(threads, PARALLEL_MAX_THREADS), for scratch of
 * its own. If a thread cannot be started, the others do its work. */
void parallel_for(unsigned threads, size_t count, size_t chunk,
                  void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context);

/* The same with threads that stay: for work that comes in thousands of short rounds, where starting threads for each
 * would cost more than the round. A waiting thread spins for some microseconds, then sleeps. */
struct pool;

/* A pool of `threads`, the caller's included; fewer if some cannot be started. NULL: out of memory. */
struct pool *pool_new(unsigned threads);
void pool_free(struct pool *pool);

/* How many there are: workers are numbered below this. */
unsigned pool_size(const struct pool *pool);

/* As parallel_for. What does not fill two chunks the caller does alone, at once. */
void pool_run(struct pool *pool, size_t count, size_t chunk,
              void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context);

#endif
