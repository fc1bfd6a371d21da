/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream's series in time, as JSON and in words. */
#ifndef TETLOD_SERIES_JSON_H
#define TETLOD_SERIES_JSON_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

#include "format/tetlod.h"

/* An option of the build, in the metadata: "step" if the bands' errors are fractions of each step's own range (SPEC
 * 3.7). */
#define SERIES_RANGE "series_range"
bool series_own_ranges(const struct tetlod_info *info);

/* NULL if memory is short. `relative_to`, `times`, `fields` (names), `bands` (error, level, vertices, tets, bytes of
 * all its steps, the largest error). */
json_t *series_json(const struct tetlod_series *series, const struct tetlod_info *info);

void series_print(FILE *out, const struct tetlod_series *series, const struct tetlod_info *info);

#endif
