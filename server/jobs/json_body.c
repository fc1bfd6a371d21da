/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/jobs/json_body.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/report/info_json.h"
#include "src/util/clock.h"

enum tetlod_status json_body(json_t *object, enum coding coding, struct cache_value *out, struct tetlod_error *error)
{
    struct buffer buffer = {0};
    double started = monotonic_seconds();
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS | JSON_INDENT(1)) : NULL;
    enum tetlod_status status = TETLOD_OK;
    json_decref(object);
    if (!text || buffer_append(&buffer, text, strlen(text)) != TETLOD_OK ||
        buffer_append(&buffer, "\n", 1) != TETLOD_OK)
        status = tetlodi_fail_nomem(error, "an answer", 0);
    free(text);
    if (status == TETLOD_OK)
        status = buffer_encode(&buffer, coding, error);
    if (status == TETLOD_OK)
        status = body_take(&buffer, started, started, out, error);
    buffer_fini(&buffer);
    return status;
}

void respond_json(struct exchange *exchange, const struct cache_value *value, const char *etag, enum coding coding)
{
    respond_body(exchange, value,
                 &(struct representation){.media_type = "application/json", .coding = coding, .etag = etag});
    cache_revalidate(exchange->response);
}

enum outcome answer_json(struct exchange *exchange, struct cache *cache, const char *key, const char *etag,
                         enum coding coding, const struct job *job)
{
    const struct cache_value *value;
    enum outcome outcome = obtain(exchange, cache, key, job, &value);
    if (value)
        respond_json(exchange, value, etag, coding);
    return outcome;
}
