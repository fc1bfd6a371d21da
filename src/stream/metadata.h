/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream's metadata: a JSON object (format/SPEC.md, 3.4). */
#ifndef TETLOD_METADATA_H
#define TETLOD_METADATA_H

#include <jansson.h>
#include <stdbool.h>

#include "format/tetlod.h"

/* The metadata as a new object, an empty one where they are anything else; NULL if memory is out. */
json_t *metadata_json(const struct tetlod_info *info);

/* Do the metadata say that the stream holds the coarse levels of another one ("part_of")? Then figures of the original
 * are that one's. */
bool metadata_is_part(const struct tetlod_info *info);

/* May the stream lack fields of its input: by the option "carry" of its build, or because no options are said? */
bool metadata_is_selection(const struct tetlod_info *info);

/* An option of the build, in the metadata: "step" if the bands' errors are fractions of each step's own range (SPEC
 * 3.7). */
#define SERIES_RANGE "series_range"
bool metadata_own_ranges(const struct tetlod_info *info);

/* The names of fields that are ids, as an array; NULL if the metadata have none. */
json_t *metadata_ids(const struct tetlod_info *info);

/* Is the name among them? */
bool metadata_is_id(const json_t *ids, const char *field);

/* The unit of the field of that name; "" if the metadata, which may be NULL, do not say it, or say what no
 * name may hold: control characters. */
const char *metadata_unit(const json_t *metadata, const char *field);

#endif
