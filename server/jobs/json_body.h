/* SPDX-License-Identifier: BSD-3-Clause */
/* Answers that are JSON. */
#ifndef TETLOD_SERVER_JSON_BODY_H
#define TETLOD_SERVER_JSON_BODY_H

#include <jansson.h>

#include "server/http/respond.h"

/* A cache value of an object, which is taken over; NULL means that memory was out. */
TETLOD_CHECKED enum tetlod_status json_body(json_t *object, enum coding coding, struct cache_value *out,
                                            struct tetlod_error *error);

#endif
