/* SPDX-License-Identifier: BSD-3-Clause */
/* Are a stream's finest level and its errors those of the mesh that it was built from? */
#ifndef TETLOD_AGAINST_H
#define TETLOD_AGAINST_H

#include "src/mesh/tetmesh.h"

enum { AGAINST_MOST_EXACT = 6 };

struct against_options {
    unsigned threads;
    void (*progress)(void *opaque, double done); /* 0..1 */
    void *progress_opaque;
};

struct against_report {
    uint32_t measured;                  /* levels whose sampled, rms and domain errors were measured again: all */
    uint32_t exact[AGAINST_MOST_EXACT]; /* levels whose certified error was held against the exact maximum, fine to coarse */
    uint32_t exact_count;
};

/* Measures every level against the mesh, whose fields have the stream's names, and takes the exact maximum over the overlay
 * at levels spread evenly from the coarsest to the one below the finest. ERR_MISMATCH names the first that is not as the
 * index says. The cursor holds all fields; it ends at level 0. */
TETLOD_CHECKED enum tetlod_status against_check(const struct tetlod_file *file, struct tetlod_cursor *cursor,
                                                const struct tetmesh *input, const struct against_options *options,
                                                struct against_report *report, struct tetlod_error *error);

#endif
