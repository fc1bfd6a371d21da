/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/time_steps.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/file_values.h"
#include "src/util/array.h"

enum tetlod_status time_steps_add(struct time_steps *steps, double time, struct tetlod_error *error)
{
    size_t at = steps->count;
    while (at > 0 && steps->at[at - 1] > time)
        at--;
    if (at > 0 && steps->at[at - 1] == time)
        return TETLOD_OK;
    if (!array_reserve((void **)&steps->at, &steps->capacity, steps->count + 1, sizeof *steps->at))
        return tetlodi_fail_nomem(error, "the steps in time", (uint64_t)steps->count * 8);
    memmove(steps->at + at + 1, steps->at + at, (steps->count - at) * sizeof *steps->at);
    steps->at[at] = time;
    steps->count++;
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

enum tetlod_status time_steps_choose(const struct time_steps *steps, const struct io_read_options *options,
                                     struct io_report *report, struct tetlod_error *error)
{
    return time_steps_pick(steps->count, steps->at, options, report, error);
}
