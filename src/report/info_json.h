/* SPDX-License-Identifier: BSD-3-Clause */
/* The JSON object that describes a stream: the same for `info --json` and for /v1/meshes/{id}. */
#ifndef TETLOD_INFO_JSON_H
#define TETLOD_INFO_JSON_H

#include <jansson.h>

#include "format/tetlod.h"

/* Flags for json_dumps: numbers round-trip exactly, keys stay in order. */
#define INFO_JSON_FLAGS (JSON_REAL_PRECISION(17) | JSON_PRESERVE_ORDER)

/* A new object, or NULL if memory is out. Errors that are not known (NaN) are left out. */
json_t *info_json(const struct tetlod_info *info, const char *id);

/* The stream's id: its file name without folders and without ".tetlod". Writes at most `size` bytes. */
void stream_id(const char *path, char *out, size_t size);

#endif
