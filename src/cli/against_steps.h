/* SPDX-License-Identifier: BSD-3-Clause */
/* Are the steps of a stream's series those that it was built from? */
#ifndef TETLOD_AGAINST_STEPS_H
#define TETLOD_AGAINST_STEPS_H

#include "src/cli/series_input.h"

/* What a stream's series is. */
struct steps_found {
    uint32_t steps;
    bool move;     /* its points do */
    uint64_t turned; /* tetrahedra that they turn over, at most at one step in one band */
};

/* Decodes every step in every band. ERR_STREAM, ERR_CHECKSUM. */
TETLOD_CHECKED enum tetlod_status steps_decode(struct tetlod_file *file, struct steps_found *found, struct tetlod_error *error);

/* Hears how much is done, 0..1. */
struct steps_watch {
    void (*progress)(void *opaque, double done);
    void *opaque;
};

struct steps_comparison {
    const struct series_input *input; /* the steps that it was built from: --times as then */
    const struct reading *reading;
    unsigned threads;
    struct steps_watch watch;
};

/* Reads every step of the input: the exact values are the input's bit for bit, and in each band no difference is above what is promised,
 * at samples and by the exact maximum over the overlay. ERR_MISMATCH names the step and the band. */
TETLOD_CHECKED enum tetlod_status steps_against(struct tetlod_file *file, const struct steps_comparison *comparison, struct tetlod_error *error);

/* How far off a field of the series is at each step in each band but the exact one, which it is measured against: at samples, as fractions
 * of the range that the bands count in. Holds as many steps at once as fit. The result does not depend on `threads`. */
struct steps_errors {
    double *sampled, *rms; /* [band][step], to be freed */
};
TETLOD_CHECKED enum tetlod_status steps_measure(struct tetlod_file *file, uint32_t field, unsigned threads, const struct steps_watch *watch,
                                                struct steps_errors *out, struct tetlod_error *error);

#endif
