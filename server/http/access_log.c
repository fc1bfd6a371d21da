/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/access_log.h"

#include <string.h>
#include <time.h>

#include "server/http/params.h"
#include "src/util/buffer.h"

static void put_json_text(struct buffer *line, const char *text)
{
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        enum tetlod_status status = c < 0x20 || c >= 0x7f || c == '"' || c == '\\'
                                        ? buffer_printf(line, "\\u%04x", c)
                                        : buffer_append(line, text, 1);
        if (status != TETLOD_OK)
            return;
    }
}

/* What opens the server does not belong into its log. */
static void hide_token(char *target)
{
    for (char *at = strchr(target, '?'); at && *at; at = strchr(at, '&'))
        if (query_begins_with(++at, "token"))
            for (at += strcspn(at, "=&"); *at && *at != '&'; at++)
                *at = *at == '=' ? '=' : '*';
}

static void log_access(const struct site *site, const struct finished *call)
{
    struct timespec now;
    struct tm utc;
    char when[32];
    struct buffer line = {0};
    clock_gettime(CLOCK_REALTIME, &now);
    gmtime_r(&now.tv_sec, &utc);
    strftime(when, sizeof when, "%Y-%m-%dT%H:%M:%S", &utc);
    bool made = buffer_printf(&line, "{\"time\": \"%s.%03ldZ\", \"id\": \"%s\", \"remote\": \"%s\", \"method\": \"",
                              when,
                              now.tv_nsec / 1000000, call->id, call->remote) == TETLOD_OK;
    put_json_text(&line, call->method);
    made &= buffer_printf(&line, "\", \"target\": \"") == TETLOD_OK;
    hide_token(call->target);
    put_json_text(&line, call->target);
    made &= buffer_printf(&line, "\", \"status\": %u, \"bytes\": %llu, \"milliseconds\": %.3f, \"complete\": %s}",
                          call->status, (unsigned long long)call->bytes, call->seconds * 1e3,
                          call->complete ? "true" : "false") == TETLOD_OK;
    if (made)
        site->access_log(site->access_log_of, (const char *)line.bytes);
    buffer_fini(&line);
}

void site_finished(const struct site *site, const struct finished *finished)
{
    metrics_request(site->metrics, finished->route, finished->status, finished->seconds, finished->bytes);
    if (site->access_log)
        log_access(site, finished);
}
