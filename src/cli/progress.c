/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/progress.h"

#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

double clock_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void progress_init(struct progress *progress, bool forced, bool quiet)
{
    *progress = (struct progress){!quiet && (forced || isatty(STDERR_FILENO)), "", clock_seconds(), 0};
}

void progress_update(struct progress *progress, const char *phase, double done)
{
    enum { WIDTH = 30 };
    double now = clock_seconds();
    if (strcmp(phase, progress->phase) != 0) {
        progress->phase = phase;
        progress->started = now;
        progress->drawn = 0;
    }
    if (!progress->shown || (now - progress->drawn < 0.2 && done < 1))
        return;
    progress->drawn = now;
    int filled = (int)(done * WIDTH);
    double left = done > 0.02 ? (now - progress->started) * (1 - done) / done : -1;
    fprintf(stderr, "\r%-9s [%.*s%*s] %3.0f %%", phase, filled, "##############################", WIDTH - filled, "",
            100 * done);
    if (left >= 0)
        fprintf(stderr, "  ETA %d:%02d ", (int)left / 60, (int)left % 60);
    fflush(stderr);
}

void progress_end(struct progress *progress)
{
    if (progress->shown)
        fprintf(stderr, "\r%70s\r", "");
}
