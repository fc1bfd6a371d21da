/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Stored bytes of a stream. libmicrohttpd sends what is in memory with the header in one call, and files in pieces of
 * 128 KiB after the header: up to a few megabytes memory is faster (tests/bench/server.py), so that records and prefixes
 * go through the cache; what is larger, ranges, and what finds no room there go from the file.
 */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "format/fail.h"
#include "server/site.h"
#include "src/util/array.h"

enum { MOST_CACHED = 4 << 20 };

struct stored_context {
    struct dataset *dataset;
    size_t count;
    uint64_t size; /* of all spans */
    struct span spans[];
};

static void stored_context_free(void *opaque)
{
    struct stored_context *context = opaque;
    dataset_release(context->dataset);
    free(context);
}

static bool read_span(const struct dataset *dataset, const struct span *span, unsigned char *out)
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
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the stream's file was written over; ask /v1/meshes/%s for its content id",
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
                         "the stream's file was written over; ask /v1/meshes/%s for its content id", dataset_id(dataset));
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

static enum outcome read_spans(struct exchange *exchange, struct dataset *dataset, const struct span *spans, size_t count,
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
                                  count > 1 ? PATIENCE : 0};
    return obtain(exchange, exchange->site->cache, key, &recipe, out);
}

enum outcome respond_spans(struct exchange *exchange, struct dataset *dataset, const struct span *spans, size_t count,
                           const char *etag)
{
    const struct representation representation = {.media_type = "application/vnd.tetlod", .etag = etag, .alone = true};
    const struct cache_value *value = obtain_cached(exchange, exchange->site->cache, etag);
    enum outcome outcome = ANSWERED;
    uint64_t size = 0;
    for (size_t i = 0; i < count; i++)
        size += spans[i].size;
    if (!value && !respond_unchanged(exchange, &representation, size))
        outcome = read_spans(exchange, dataset, spans, count, size, etag, &value);
    if (value)
        respond_body(exchange, value, &representation);
    return outcome;
}

enum outcome respond_stored(struct exchange *exchange, struct dataset *dataset, uint64_t offset, uint64_t size,
                            const char *etag)
{
    const struct span span = {offset, size};
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
