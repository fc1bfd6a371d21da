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
 * its own. A thread that cannot be started is done without. */
void parallel_for(unsigned threads, size_t count, size_t chunk,
                  void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context);

#endif
