/* SPDX-License-Identifier: BSD-3-Clause */
/* Are a stream's finest level and its errors those of the mesh that it was built from? */
#ifndef TETLOD_AGAINST_H
#define TETLOD_AGAINST_H

#include "src/mesh/tetmesh.h"

/* Unless all levels are asked for, the exact maximum is taken of that many levels where they have more tetrahedra
 * together, each times those of the original, than that. */
enum { AGAINST_MAX_EXACT = 6 };

struct against_options {
    unsigned threads;
    bool all_levels;
    void (*progress)(void *opaque, double done); /* 0..1 */
    void *progress_opaque;
};

struct against_report {
    /* levels whose sampled and rms errors were measured again: all, or none where the original's numbers are not
     * known */
    uint32_t measured;
    /* [exact_count] levels whose certified error was held against the exact maximum, fine to coarse; to be freed */
    uint32_t *exact;
    uint32_t exact_count;
};

/* Measures every level against the mesh, whose fields have the stream's names. ERR_MISMATCH names the first level that
 * is not as the index says: a `max` or domain error that is too small, a sampled or rms error that is too small or too
 * large.
 *
 * The finest level has to be the mesh, rounded to the stream's grids, with its values of cells. So each vertex of the
 * stream is found in the mesh, each body is compared with itself, and what a figure may be where rounding or overlaps
 * leave a choice is worked out before it is refused. Of a part of a stream, whose finest level is not the mesh, and
 * where many vertices are alike, only `max` and the domain error are held, against the best of the values at a place.
 *
 * The cursor holds all fields; it ends at level 0. */
TETLOD_CHECKED enum tetlod_status against_check(const struct tetlod_file *file, struct tetlod_cursor *cursor,
                                                const struct tetmesh *input, const struct against_options *options,
                                                struct against_report *report, struct tetlod_error *error);

#endif
