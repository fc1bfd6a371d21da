/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/time_steps.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/services/file_values.h"
#include "src/util/array.h"

enum tetlod_status time_steps_add(struct time_steps *steps, double time, struct tetlod_error *error)
{
    if (!ARRAY_RESERVE(steps->at, steps->capacity, steps->count + 1))
        return tetlodi_fail_nomem(error, "the steps in time", (uint64_t)steps->count * 8);
    steps->at[steps->count++] = time;
    return TETLOD_OK;
}

void time_steps_fini(struct time_steps *steps)
{
    free(steps->at);
    *steps = (struct time_steps){0};
}

enum tetlod_status time_steps_pick(uint64_t count, const double *times, const struct io_read_options *options,
                                   struct io_report *report, struct tetlod_error *error)
{
    const char *wanted = options && options->time ? options->time : "last";
    struct text text = {wanted, wanted + strlen(wanted)};
    int64_t step = (int64_t)count - 1;
    if (strcmp(wanted, "last") != 0 && (!text_int(&text, &step) || step < 0 || (uint64_t)step >= count))
        return tetlodi_fail(error, TETLOD_ERR_MESH, "has %llu steps in time, 0 to %llu; there is no step '%.40s'",
                            (unsigned long long)count, (unsigned long long)(count - 1), wanted);
    report->steps = count;
    report->step = (uint64_t)step;
    report->time = times ? times[step] : (double)step;
    return TETLOD_OK;
}

static int compare_times(const void *a, const void *b)
{
    double x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return (x > y) - (x < y);
}

enum tetlod_status time_steps_choose(struct time_steps *steps, const struct io_read_options *options,
                                     struct io_report *report, struct tetlod_error *error)
{
    size_t kept = 0;
    if (steps->count)
        qsort(steps->at, steps->count, sizeof *steps->at, compare_times);
    for (size_t i = 0; i < steps->count; i++)
        if (kept == 0 || steps->at[i] != steps->at[kept - 1])
            steps->at[kept++] = steps->at[i];
    steps->count = kept;
    return time_steps_pick(steps->count, steps->at, options, report, error);
}
