/* SPDX-License-Identifier: BSD-3-Clause */
/* Answers that are JSON. */
#ifndef TETLOD_SERVER_JSON_BODY_H
#define TETLOD_SERVER_JSON_BODY_H

#include <jansson.h>

#include "server/http/respond.h"
#include "server/jobs/obtain.h"

/* A cache value of an object, which is taken over; NULL means that memory was out. */
TETLOD_CHECKED enum tetlod_status json_body(json_t *object, enum coding coding, struct cache_value *out,
                                            struct tetlod_error *error);

/* Answers with such a value, which clients ask for again. */
void respond_json(struct exchange *exchange, const struct cache_value *value, const char *etag, enum coding coding);

/* The same of the value of a key, which the job makes where it is not there. */
enum outcome answer_json(struct exchange *exchange, struct cache *cache, const char *key, const char *etag,
                         enum coding coding, const struct job *job);

#endif
