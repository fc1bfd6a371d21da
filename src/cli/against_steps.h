/* SPDX-License-Identifier: BSD-3-Clause */
/* Are the steps of a stream's series those that it was built from? */
#ifndef TETLOD_AGAINST_STEPS_H
#define TETLOD_AGAINST_STEPS_H

#include "src/cli/series_input.h"

/* The range of a field over all steps. */
struct steps_range {
    char *name;
    bool of_group; /* it counts in its topology group alone: how far points move */
    double declared[2], found[2];
    double room; /* by which the values that were found may be off */
};

/* What a stream's series is. */
struct steps_found {
    uint32_t steps;
    bool move;     /* its points do */
    uint64_t turned; /* tetrahedra that they turn over, at most at one step in one band */
    struct steps_range *ranges; /* [range_count] */
    uint32_t range_count;
};

/* Decodes every step in every band; their times rise. To be released, also after a failure. ERR_STREAM, ERR_CHECKSUM,
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status steps_decode(struct tetlod_file *file, struct steps_found *found,
                                               struct tetlod_error *error);
void steps_found_fini(struct steps_found *found);

/* Adds what was found of a further topology group. ERR_STREAM if it says other ranges. */
TETLOD_CHECKED enum tetlod_status steps_found_add(struct steps_found *all, const struct steps_found *group,
                                                  struct tetlod_error *error);

/* Are the ranges that the tables say those of the values? `of_groups`: those that count in a group alone, or the
 * others. ERR_STREAM. */
TETLOD_CHECKED enum tetlod_status steps_check_ranges(const struct steps_found *found, bool of_groups,
                                                     struct tetlod_error *error);

/* Hears how much is done, 0..1. */
struct steps_watch {
    void (*progress)(void *opaque, double done);
    void *opaque;
};

struct steps_comparison {
    const struct series_input *input; /* the steps that it was built from: --times as then */
    const struct reading *reading;
    unsigned threads;
    bool in_groups; /* the stream is one of several topology groups, whose times were looked at together */
    struct steps_watch watch;
};

/* Reads every step of the input: its time and the exact values are the input's bit for bit, and in each band no
 * difference is above what is promised, by the exact maximum over the overlay. ERR_MISMATCH names the step and the
 * band. */
TETLOD_CHECKED enum tetlod_status steps_against(struct tetlod_file *file, const struct steps_comparison *comparison,
                                                struct tetlod_error *error);

/* How far off a field of the series is at each step in each band but the exact one, which it is measured against: at
 * samples, as fractions of the range that the bands count in. Holds as many steps at once as fit. The result does not
 * depend on `threads`. */
struct steps_errors {
    double *sampled, *rms; /* [band][step], to be freed */
};
TETLOD_CHECKED enum tetlod_status steps_measure(struct tetlod_file *file, uint32_t field, unsigned threads,
                                                const struct steps_watch *watch,
                                                struct steps_errors *out, struct tetlod_error *error);

#endif
