/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Threads that stay: for work that comes in thousands of short rounds, where starting threads for each would cost more
 * than the round. A waiting thread spins for some microseconds, then sleeps.
 */
#ifndef TETLOD_CREW_H
#define TETLOD_CREW_H

#include <stddef.h>

struct crew;

/* A crew of `threads`, the caller's included; fewer if some cannot be started. NULL: out of memory. */
struct crew *crew_new(unsigned threads);
void crew_free(struct crew *crew);

/* How many there are: workers are numbered below this. */
unsigned crew_size(const struct crew *crew);

/* Calls body(context, worker, begin, end) until chunks of at most `chunk` have covered 0 .. count. What does not fill
 * two chunks the caller does alone. What a range computes must not depend on how the whole was cut. */
void crew_run(struct crew *crew, size_t count, size_t chunk,
              void (*body)(void *context, unsigned worker, size_t begin, size_t end), void *context);

#endif
