/* SPDX-License-Identifier: BSD-3-Clause */
/* Steps of a series, through all topology groups. */
#ifndef TETLOD_SERIES_TIME_H
#define TETLOD_SERIES_TIME_H

#include <stdbool.h>

#include "format/tetlod.h"

/* Steps of the topology groups before one. */
uint32_t series_steps_before(const struct tetlod_info *info, uint32_t topology);

/* All steps, through all topology groups. */
uint32_t series_step_count(const struct tetlod_info *info, const struct tetlod_series_info *steps);

/* The times that a series has, through all topology groups: from `first` to `last`. */
struct series_times {
    double first, last;
};

/* False: the time is more than half a step outside of the times that there are. `steps` are those of the first group.
 */
bool series_has_time(const struct tetlod_info *info, const struct tetlod_series_info *steps, double time,
                     struct series_times *out);

/* Beyond half a step outside of the series the nearest step is not what was meant: ERR_ARGUMENT. */
TETLOD_CHECKED enum tetlod_status series_check_time(const struct tetlod_file *file, double time,
                                                    struct tetlod_error *error);

#endif
