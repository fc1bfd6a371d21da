/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/series_time.h"

#include "src/report/series_json.h"

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
