/* SPDX-License-Identifier: BSD-3-Clause */
/* Is there a step near a time? */
#ifndef TETLOD_SERIES_TIME_H
#define TETLOD_SERIES_TIME_H

#include <stdbool.h>

#include "format/tetlod.h"

/* The times that a series has, through all topology groups: from `first` to `last`. */
struct series_times {
    double first, last;
};

/* False: the time is more than half a step outside of the times that there are. `steps` are those of the first group.
 */
bool series_has_time(const struct tetlod_info *info, const struct tetlod_series_info *steps, double time,
                     struct series_times *out);

#endif
