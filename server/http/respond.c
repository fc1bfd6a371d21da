/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/respond.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/access.h"
#include "server/http/conditions.h"
#include "server/http/params.h"
#include "src/util/array.h"
#include "src/util/clock.h"
#include "src/util/number_text.h"

void cache_forever(struct exchange *exchange)
{
    response_header(exchange->response, "Cache-Control", "%s, max-age=31536000, immutable, no-transform",
                    access_private(exchange->policy) ? "private" : "public");
}

void cache_revalidate(struct response *response)
{
    response_header_text(response, "Cache-Control", "no-cache");
}

void link_description(struct exchange *exchange)
{
    char up[3 * 64] = "";
    size_t used = 0;
    for (const char *c = exchange->path + 1; *c && *c != '?' && used + 4 < sizeof up; c++)
        if (*c == '/')
            used += (size_t)snprintf(up + used, sizeof up - used, "../");
    response_header(exchange->response, "Link", "<%sopenapi.json>; rel=\"service-desc\"", up);
}

enum outcome answer_immutable(struct exchange *exchange, enum outcome outcome)
{
    if (outcome == ANSWERED && exchange->response->status == 200)
        cache_forever(exchange);
    return outcome;
}

static void body_free(void *opaque)
{
    struct body *body = opaque;
    free(body->bytes);
    free(body);
}

enum tetlod_status body_take(struct buffer *buffer, double started, double extracted, struct cache_value *out,
                             struct tetlod_error *error)
{
    struct body *body = array_new(1, sizeof *body);
    unsigned char *exact = buffer->size ? array_resize(buffer->bytes, buffer->size, 1) : NULL;
    if (exact)
        buffer->bytes = exact; // what it grew beyond its size is not counted
    if (!body)
        return tetlodi_fail_nomem(error, "an answer", sizeof *body);
    *body = (struct body){.size = buffer->size, .bytes = buffer->bytes};
    snprintf(body->timing, sizeof body->timing, "extract;dur=%.2f, make;dur=%.2f", (extracted - started) * 1e3,
             (monotonic_seconds() - started) * 1e3);
    *out = (struct cache_value){body, sizeof *body + buffer->size, body_free};
    *buffer = (struct buffer){0};
    return TETLOD_OK;
}

/* ---- answers ---- */

static void print_etag(const struct representation *representation, char out[static ETAG_CAPACITY])
{
    enum coding coding = representation->coding;
    snprintf(out, ETAG_CAPACITY, "\"%s%s%s\"", representation->etag, coding ? "-" : "", coding_name(coding));
}

void respond_representation(struct response *response, const struct representation *representation)
{
    enum coding coding = representation->coding;
    response->status = 200;
    response->media_type = representation->media_type;
    response->ranges = coding == CODING_IDENTITY;
    print_etag(representation, response->etag);
    if (coding)
        response_header_text(response, "Content-Encoding", coding_name(coding));
    if (!representation->alone)
        response_vary(response, "Accept-Encoding");
}

void respond_body(struct exchange *exchange, const struct cache_value *value,
                  const struct representation *representation)
{
    struct response *response = exchange->response;
    const struct body *body = value->data; // pinned by the request
    respond_representation(response, representation);
    response->kind = BODY_BYTES;
    response->bytes = body->bytes;
    response->size = body->size;
    response_header(response, "Server-Timing", "cache;desc=%s, %s", exchange->request->waited ? "miss" : "hit",
                    body->timing);
}

bool respond_unchanged(struct exchange *exchange, const struct representation *representation, uint64_t size)
{
    struct response *response = exchange->response;
    char etag[ETAG_CAPACITY];
    print_etag(representation, etag);
    if (!etag_list_has(request_header(exchange->request, "If-None-Match"), etag))
        return false;
    respond_representation(response, representation);
    respond_absent(response, size);
    return true;
}

void respond_absent(struct response *response, uint64_t size)
{
    response->kind = BODY_ABSENT;
    response->size = size;
}

void respond_failure(struct exchange *exchange, const struct tetlod_error *error)
{
    const char *message = error->message[0] ? error->message : tetlod_status_text(error->status);
    unsigned status = 500;
    switch (error->status) {
    case TETLOD_ERR_NOMEM:
    case TETLOD_ERR_LIMIT:
    case TETLOD_ERR_IO:
    case TETLOD_ERR_CHECKSUM: // damaged, or half a copy
    case TETLOD_ERR_TRUNCATED:
        status = 503;
        break;
    case TETLOD_ERR_ARGUMENT: // more than the cache may hold
        status = 422;
        break;
    case TETLOD_ERR_MISMATCH: // the file is another one
        status = 404;
        break;
    default:
        break;
    }
    response_problem(exchange->response, status, exchange->request->target, "%s", message);
}

/* ---- of streams and levels ---- */

enum { MAX_NAMED = 100 };

enum outcome respond_no_memory(struct exchange *exchange)
{
    response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
    return ANSWERED;
}

enum outcome respond_hanging(struct exchange *exchange, const struct dataset *dataset)
{
    response_problem(exchange->response, 503, exchange->request->target, "the file of '%s' does not answer",
                     dataset_id(dataset));
    return ANSWERED;
}

static void respond_no_mesh(struct exchange *exchange)
{
    size_t count = 0;
    struct dataset **list = catalogue_list(exchange->site->catalogue, MAX_NAMED, &count, NULL);
    json_t *ids = json_array();
    for (size_t i = 0; list && i < count; i++) {
        json_array_append_new(ids, json_string(dataset_id(list[i])));
        dataset_release(list[i]);
    }
    free(list);
    response_problem_choices(exchange->response, 404, exchange->request->target, "meshes", ids, "there is no mesh '%s'",
                             exchange->captures[0]);
}

struct dataset *named_dataset(struct exchange *exchange)
{
    struct dataset *dataset = catalogue_find(exchange->site->catalogue, exchange->captures[0]);
    if (!dataset)
        respond_no_mesh(exchange);
    return dataset;
}

json_t *json_texts(const char *const *list, size_t count)
{
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++)
        json_array_append_new(array, json_string(list[i]));
    return array;
}

json_t *field_names(const struct tetlod_info *info)
{
    json_t *array = json_array();
    for (uint32_t f = 0; f < info->field_count; f++)
        json_array_append_new(array, json_string(info->fields[f].name));
    return array;
}

bool check_parameters_of(struct exchange *exchange, const char *names)
{
    char unknown[64];
    const char *name;
    size_t size;
    if (!query_unknown(exchange->query, names, unknown, sizeof unknown))
        return true;
    json_t *list = json_array();
    while ((size = next_name(&names, &name)))
        json_array_append_new(list, json_stringn(name, size));
    response_problem_choices(exchange->response, 400, exchange->request->target, "parameters", list,
                             "there is no parameter '%s' here", unknown);
    return false;
}

bool check_parameters(struct exchange *exchange)
{
    return check_parameters_of(exchange, exchange->parameters);
}

void level_headers(struct response *response, const struct dataset *dataset, uint32_t level)
{
    const struct level_texts *texts = dataset_level_texts(dataset, level);
    response_header_text(response, "Tetlod-Level", texts->level);
    response_header_text(response, "Tetlod-Vertices", texts->vertices);
    response_header_text(response, "Tetlod-Tets", texts->tets);
    if (texts->errors[0])
        response_header_text(response, "Tetlod-Error", texts->errors);
    if (texts->uncontrolled[0])
        response_header_text(response, "Tetlod-Uncontrolled", texts->uncontrolled);
}

void name_download(struct exchange *exchange, const char *format, ...)
{
    char rest[64], plain[ID_CAPACITY + 64], encoded[3 * (ID_CAPACITY + 64)];
    va_list arguments;
    if (exchange->response->status != 200)
        return;
    va_start(arguments, format);
    vsnprintf(rest, sizeof rest, format, arguments);
    va_end(arguments);
    snprintf(plain, sizeof plain, "%s%s", dataset_id(exchange->dataset), rest);
    bool encodes = percent_encode(plain, encoded, sizeof encoded);
    for (char *c = plain; *c; c++) // for clients that know nothing but ASCII
        if (*c < 0x20 || *c > 0x7e || strchr("\"\\/%", *c))
            *c = '_';
    if (encodes)
        response_header(exchange->response, "Content-Disposition", "attachment; filename=\"%s\"; filename*=UTF-8''%s",
                        plain, encoded);
}

struct dataset *captured_dataset(struct exchange *exchange)
{
    const char *id = exchange->captures[0], *cid = exchange->captures[1];
    struct dataset *dataset = catalogue_find_content(exchange->site->catalogue, id, cid, monotonic_seconds());
    if (dataset)
        return dataset;
    struct dataset *current = named_dataset(exchange);
    if (!current)
        return NULL;
    json_t *cids = json_array();
    json_array_append_new(cids, json_string(dataset_info(current)->cid));
    response_problem_choices(exchange->response, 404, exchange->request->target, "cid", cids,
                             "'%s' has another content id now; v1/meshes/{id} tells which", id);
    dataset_release(current);
    return NULL;
}

bool take_number(struct exchange *exchange, const char *text, const char *name, uint32_t count, uint32_t *out)
{
    uint64_t number;
    if (text_count(text, false, &number) && number < count) {
        *out = (uint32_t)number;
        return true;
    }
    response_problem(exchange->response, 400, exchange->request->target, "%ss go from 0 to %" PRIu32 ", not '%s'",
                     name, count - 1, text);
    return false;
}

bool parse_level(struct exchange *exchange, const struct tetlod_info *info, const char *text, uint32_t *out)
{
    return take_number(exchange, text, "level", info->level_count, out);
}
