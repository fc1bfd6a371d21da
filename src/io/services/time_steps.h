/* SPDX-License-Identifier: BSD-3-Clause */
/* The steps in time that a file holds, and the choice of one. */
#ifndef TETLOD_TIME_STEPS_H
#define TETLOD_TIME_STEPS_H

#include "format/tetlod.h"
#include "src/io/services/report.h"

struct time_steps {
    double *at; /* owned; ascending and different once one has been chosen */
    size_t count, capacity;
};

TETLOD_CHECKED enum tetlod_status time_steps_add(struct time_steps *steps, double time, struct tetlod_error *error);
void time_steps_fini(struct time_steps *steps);

/* Sorts them and fills the report's steps, step and time by what the options ask for; options may be NULL. */
TETLOD_CHECKED enum tetlod_status time_steps_choose(struct time_steps *steps, const struct io_read_options *options,
                                                    struct io_report *report, struct tetlod_error *error);

/* The same for `count` steps whose times are not sorted; times may be NULL. */
TETLOD_CHECKED enum tetlod_status time_steps_pick(uint64_t count, const double *times,
                                                  const struct io_read_options *options,
                                                  struct io_report *report, struct tetlod_error *error);

#endif
