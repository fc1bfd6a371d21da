/* SPDX-License-Identifier: BSD-3-Clause */
/* A progress bar on standard error, with the time that is left. */
#ifndef TETLOD_PROGRESS_H
#define TETLOD_PROGRESS_H

#include <stdbool.h>

struct progress {
    bool shown;
    const char *phase;
    double started, drawn;
};

double clock_seconds(void); /* monotonic */

/* Shown where standard error is a terminal, or if forced; never if quiet. */
void progress_init(struct progress *progress, bool forced, bool quiet);

/* `done` 0..1 of a phase; draws a few times a second. */
void progress_update(struct progress *progress, const char *phase, double done);

/* Clears the bar. */
void progress_end(struct progress *progress);

#endif
