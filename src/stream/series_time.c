/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/stream/series_time.h"

#include "format/fail.h"

uint32_t series_steps_before(const struct tetlod_info *info, uint32_t topology)
{
    uint32_t steps = 0;
    for (uint32_t t = 0; t < topology && t < info->topology_count; t++)
        steps += info->topologies[t].step_count;
    return steps;
}

uint32_t series_step_count(const struct tetlod_info *info, const struct tetlod_series_info *steps)
{
    return info->topology_count ? series_steps_before(info, info->topology_count) : steps->step_count;
}

static double time_at(const struct tetlod_info *info, const struct tetlod_series_info *steps, uint32_t number)
{
    uint32_t step, topology = info->topology_count ? tetlod_topology_of_step(info, number, &step) : TETLOD_NONE;
    return topology == TETLOD_NONE ? steps->times[number] : info->topologies[topology].times[step];
}

bool series_has_time(const struct tetlod_info *info, const struct tetlod_series_info *steps, double time,
                     struct series_times *out)
{
    uint32_t count = series_step_count(info, steps), second = 0, before = count - 1;
    out->first = time_at(info, steps, 0);
    out->last = time_at(info, steps, count - 1);
    while (second < count - 1 && !(time_at(info, steps, second) > out->first))
        second++;
    while (before && !(time_at(info, steps, before) < out->last))
        before--;
    return time >= out->first - (time_at(info, steps, second) - out->first) / 2 &&
           time <= out->last + (out->last - time_at(info, steps, before)) / 2;
}

enum tetlod_status series_check_time(const struct tetlod_file *file, double time, struct tetlod_error *error)
{
    struct tetlod_series *series;
    struct series_times times;
    TETLOD_TRY(tetlod_series_new(&series, file, error));
    bool near = series_has_time(tetlod_info(file), tetlod_series_info(series), time, &times);
    tetlod_series_free(series);
    return near ? TETLOD_OK
                : tetlodi_fail(error, TETLOD_ERR_ARGUMENT,
                               "it has no time %.9g: its times go from %.9g to %.9g; the nearest is %.9g", time,
                               times.first, times.last, time < times.first ? times.first : times.last);
}
