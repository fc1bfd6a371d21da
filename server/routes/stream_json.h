/* SPDX-License-Identifier: BSD-3-Clause */
/* Streams as JSON, with the links between the resources of the API. New references; NULL if memory is out. */
#ifndef TETLOD_SERVER_STREAM_JSON_H
#define TETLOD_SERVER_STREAM_JSON_H

#include <jansson.h>

#include "server/store/dataset.h"

/* /v1/meshes/{id}: what `tetlod info --json` prints, and links. */
json_t *describe_stream(const struct dataset *dataset, const char *id);

/* An element of /v1/meshes. */
json_t *describe_in_catalogue(const struct tetlod_info *info, const char *id);

#endif
