/* SPDX-License-Identifier: BSD-3-Clause */
/* Features as JSON, as `features --json` writes them, and as tables of points. */
#ifndef TETLOD_FEATURES_JSON_H
#define TETLOD_FEATURES_JSON_H

#include <jansson.h>

#include "format/common/sink.h"
#include "src/ask/feature_levels.h"

/* A new object, or NULL if memory is out. `field` is the text that named the quantity. `info` is NULL of a mesh
 * file. */
json_t *features_json(const struct tetlod_info *info, const char *field, const struct feature_answer *answer);

/* A line for each feature below a line of names, or a file for VTK with a point for each. */
TETLOD_CHECKED enum tetlod_status features_write_csv(const struct features *features, const struct tetlodi_sink *sink,
                                                     struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status features_write_vtu(const struct features *features, const struct tetlodi_sink *sink,
                                                     struct tetlod_error *error);

#endif
