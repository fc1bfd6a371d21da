/* SPDX-License-Identifier: BSD-3-Clause */
/* Work on ranges by several threads. What a range computes must not depend on how the whole was cut. */
#ifndef TETLOD_PARALLEL_H
#define TETLOD_PARALLEL_H

#include <stddef.h>

/* Cores that this process may use, at least 1. */
unsigned parallel_cores(void);

/* Calls body(context, begin, end) until chunks of at most `chunk` have covered 0 .. count, on `threads` threads (the
 * caller's included). A thread that cannot be started is done without. */
void parallel_for(unsigned threads, size_t count, size_t chunk, void (*body)(void *context, size_t begin, size_t end),
                  void *context);

#endif
