/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream's series in time, as JSON and in words. */
#ifndef TETLOD_SERIES_JSON_H
#define TETLOD_SERIES_JSON_H

#include <jansson.h>
#include <stdio.h>

#include "format/tetlod.h"

/* NULL if memory is short. `relative_to`, `times`, `fields` (names), `bands` (error, level, vertices, tets, bytes of
 * all its steps, the largest error). */
json_t *series_json(const struct tetlod_series *series, const struct tetlod_info *info);

void series_print(FILE *out, const struct tetlod_series *series, const struct tetlod_info *info);

#endif
