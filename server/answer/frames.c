/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/frames.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "format/fail.h"
#include "format/reader.h"
#include "server/answer/obtain.h"
#include "server/answer/respond.h"
#include "src/util/array.h"
#include "src/util/clock.h"

enum { MOST_CACHED = 4 << 20 };

struct stored_context {
    struct dataset *dataset;
    size_t count;
    uint64_t size; /* of all spans */
    struct tetlod_span spans[];
};

static void stored_context_free(void *opaque)
{
    struct stored_context *context = opaque;
    dataset_release(context->dataset);
    free(context);
}

static bool read_span(const struct dataset *dataset, const struct tetlod_span *span, unsigned char *out)
{
    uint64_t done = 0;
    while (done < span->size) {
        ssize_t got = pread(dataset_fd(dataset), out + done, (size_t)(span->size - done), (off_t)(span->offset + done));
        if (got <= 0)
            return false;
        done += (uint64_t)got;
    }
    return true;
}

static enum tetlod_status read_stored(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct stored_context *context = opaque;
    double started = monotonic_seconds();
    struct buffer buffer = {0};
    bool complete = true;
    for (size_t i = 0; complete && i < context->count; i++) {
        unsigned char *place = buffer_extend(&buffer, (size_t)context->spans[i].size);
        if (!place) {
            buffer_fini(&buffer);
            return tetlodi_fail_nomem(error, "stored bytes", context->size);
        }
        complete = read_span(context->dataset, &context->spans[i], place);
    }
    if (!complete || !dataset_intact(context->dataset)) {
        buffer_fini(&buffer);
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the stream's file was written over; ask v1/meshes/%s for its content id",
                            dataset_id(context->dataset));
    }
    return body_take(&buffer, started, started, out, error);
}

static void release_dataset(void *owner)
{
    dataset_release(owner);
}

static void respond_file(struct exchange *exchange, struct dataset *dataset, uint64_t offset, uint64_t size, const char *etag)
{
    struct response *response = exchange->response;
    if (!dataset_intact(dataset)) {
        response_problem(response, 404, exchange->request->target,
                         "the stream's file was written over; ask v1/meshes/%s for its content id", dataset_id(dataset));
        return;
    }
    response->release = release_dataset;
    response->owner = dataset_hold(dataset);
    response->status = 200;
    response->media_type = "application/vnd.tetlod";
    response->kind = BODY_FILE;
    response->fd = dataset_fd(dataset);
    response->offset = offset;
    response->size = size;
    response->ranges = true;
    snprintf(response->etag, sizeof response->etag, "\"%s\"", etag);
}

static enum outcome read_spans(struct exchange *exchange, struct dataset *dataset, const struct tetlod_span *spans, size_t count,
                               uint64_t size, const char *key, const struct cache_value **out)
{
    struct stored_context *context = malloc(sizeof *context + count * sizeof *spans);
    if (!context) {
        *out = NULL;
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    *context = (struct stored_context){dataset_hold(dataset), count, size};
    for (size_t i = 0; i < count; i++)
        context->spans[i] = spans[i];
    const struct recipe recipe = {read_stored, stored_context_free, context, size + size / 2 /* as it grows */,
                                  count > 1 ? PATIENCE : 0, NULL};
    return obtain(exchange, cache_for(exchange->site, recipe.bytes), key, &recipe, out);
}

/* Answers with several pieces of a stream, one after the other. */
static enum outcome respond_spans(struct exchange *exchange, struct dataset *dataset, const struct tetlod_span *spans, size_t count,
                           const char *etag)
{
    const struct representation representation = {.media_type = "application/vnd.tetlod", .etag = etag, .alone = true};
    enum outcome outcome = ANSWERED;
    uint64_t size = 0;
    for (size_t i = 0; i < count; i++)
        size += spans[i].size;
    const struct cache_value *value = obtain_cached(exchange, cache_for(exchange->site, size + size / 2), etag);
    if (!value && !respond_unchanged(exchange, &representation, size))
        outcome = read_spans(exchange, dataset, spans, count, size, etag, &value);
    if (value)
        respond_body(exchange, value, &representation);
    return outcome;
}

/* Answers with stored bytes of a stream: from the cache where they are not many, straight from the file otherwise. */
static enum outcome respond_stored(struct exchange *exchange, struct dataset *dataset, uint64_t offset, uint64_t size,
                            const char *etag)
{
    const struct tetlod_span span = {offset, size};
    struct response *response = exchange->response;
    if (size <= MOST_CACHED && !request_header(exchange->request, "Range")) {
        enum outcome outcome = respond_spans(exchange, dataset, &span, 1, etag);
        if (outcome == WAITING || response->status == 200)
            return outcome;
        response_release(response); // no room in the cache; where something else is wrong, it is with the file as well
        response->header_count = 0;
    }
    respond_file(exchange, dataset, offset, size, etag);
    return ANSWERED;
}

/* ---- frames ---- */

enum outcome respond_level_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char etag[80];
    snprintf(etag, sizeof etag, "%s-%" PRIu32 "-tetlod", info->cid, level);
    return respond_stored(exchange, dataset, 0, info->levels[level].end, etag);
}

/* Which fields a list of names selects, as text of 0 and 1 for the entity tag. */
static bool select_fields(struct exchange *exchange, const struct tetlod_info *info, char *list, char *selected)
{
    memset(selected, '0', info->field_count);
    selected[info->field_count] = 0;
    for (char *name = list, *next; name && *list; name = next) {
        next = strchr(name, ',');
        if (next)
            *next++ = 0;
        uint32_t field = tetlod_field_index(info, name);
        if (field == TETLOD_NONE) {
            response_problem_choices(exchange->response, 400, exchange->request->target, "fields", field_names(info),
                                     "there is no field '%.128s'; fields are separated by commas", name);
            return false;
        }
        selected[field] = '1';
    }
    return true;
}

/* Header and index if they are asked for, then the frames of levels first .. last: geometry and the selected fields, in the
 * order of the stream. */
static enum outcome answer_frames(struct exchange *exchange, struct dataset *dataset, bool index_too, uint32_t first,
                                  uint32_t last, const char *selected)
{
    const struct tetlod_file *file = dataset_file(dataset);
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t fields[MOST_FIELDS], count = 0, from = index_too ? TETLOD_NONE : first - 1;
    for (uint32_t f = 0; f < info->field_count; f++)
        if (selected[f] == '1')
            fields[count++] = f;
    size_t most = tetlod_spans(file, from, last, fields, count, NULL, 0);
    struct tetlod_span *spans = array_new(most, sizeof *spans);
    if (!spans) {
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    tetlod_spans(file, from, last, fields, count, spans, most);
    char etag[80 + MOST_FIELDS];
    snprintf(etag, sizeof etag, "%s-%s%" PRIu32 "-%" PRIu32 "-%s", info->cid, index_too ? "i" : "", first, last, selected);
    enum outcome outcome = respond_spans(exchange, dataset, spans, most, etag);
    free(spans);
    return outcome;
}

/* The list of fields that the query has, as select_fields makes it; QUERY_BAD: answered. */
static enum query_result query_fields(struct exchange *exchange, const struct tetlod_info *info, char *selected)
{
    char list[1024];
    enum query_result result = query_value(exchange->query, "fields", list, sizeof list);
    if (result == QUERY_BAD)
        response_problem(exchange->response, 400, exchange->request->target, "fields is one list of names");
    else if (result == QUERY_FOUND && !select_fields(exchange, info, list, selected))
        result = QUERY_BAD;
    return result;
}

enum outcome respond_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level)
{
    char selected[MOST_FIELDS + 1];
    switch (query_fields(exchange, dataset_info(dataset), selected)) {
    case QUERY_FOUND:
        return answer_frames(exchange, dataset, true, 0, level, selected);
    case QUERY_ABSENT:
        return respond_level_prefix(exchange, dataset, level);
    default:
        return ANSWERED;
    }
}

static enum outcome answer_records(struct exchange *exchange, struct dataset *dataset, uint32_t from, uint32_t to)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char selected[MOST_FIELDS + 1], etag[80];
    enum query_result result = query_fields(exchange, info, selected);
    if (result == QUERY_FOUND)
        return answer_immutable(exchange, answer_frames(exchange, dataset, false, from + 1, to, selected));
    if (result == QUERY_BAD)
        return ANSWERED;
    uint64_t offset = info->levels[from + 1].offset;
    snprintf(etag, sizeof etag, "%s-%" PRIu32 "-%" PRIu32, info->cid, from, to);
    return answer_immutable(exchange, respond_stored(exchange, dataset, offset, info->levels[to].end - offset, etag));
}

enum outcome handle_records(struct exchange *exchange)
{
    static const char *const names[] = {"fields", NULL};
    struct dataset *dataset = captured_dataset(exchange);
    enum outcome outcome = ANSWERED;
    uint32_t from, to;
    if (!dataset)
        return ANSWERED;
    const struct tetlod_info *info = dataset_info(dataset);
    if (check_parameters(exchange, names) && parse_level(exchange, info, exchange->captures[2], &from) &&
        parse_level(exchange, info, exchange->captures[3], &to)) {
        if (from >= to)
            response_problem(exchange->response, 400, exchange->request->target,
                             "records go from a level to a finer one, not from %" PRIu32 " to %" PRIu32, from, to);
        else
            outcome = answer_records(exchange, dataset, from, to);
    }
    dataset_release(dataset);
    return outcome;
}

enum outcome handle_stream(struct exchange *exchange)
{
    static const char *const none[] = {NULL};
    struct dataset *dataset = captured_dataset(exchange);
    enum outcome outcome = ANSWERED;
    if (!dataset)
        return ANSWERED;
    const struct tetlod_info *info = dataset_info(dataset);
    if (check_parameters(exchange, none))
        outcome = answer_immutable(exchange, respond_stored(exchange, dataset, 0, info->bytes, info->cid));
    dataset_release(dataset);
    return outcome;
}
