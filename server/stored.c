/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Stored bytes of a stream. libmicrohttpd sends what is in memory with the header in one call, and files in pieces of
 * 128 KiB after the header: up to a few megabytes memory is faster (tests/bench/server.py), so that records and prefixes
 * go through the cache and only what is larger, and ranges, go from the file.
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
    uint64_t offset, size;
};

static void stored_context_free(void *opaque)
{
    struct stored_context *context = opaque;
    dataset_release(context->dataset);
    free(context);
}

static enum tetlod_status read_stored(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct stored_context *context = opaque;
    double started = monotonic_seconds();
    size_t size = (size_t)context->size, done = 0;
    struct body *body = malloc(sizeof *body + size);
    if (!body)
        return tetlodi_fail_nomem(error, "stored bytes", size);
    while (done < size) {
        ssize_t got = pread(dataset_fd(context->dataset), body->bytes + done, size - done, (off_t)(context->offset + done));
        if (got <= 0)
            break;
        done += (size_t)got;
    }
    if (done < size || !dataset_intact(context->dataset)) {
        free(body);
        return tetlodi_fail(error, TETLOD_ERR_MISMATCH, "the stream's file was written over; ask /v1/meshes/%s for its content id",
                            dataset_id(context->dataset));
    }
    body->size = size;
    body->milliseconds = (monotonic_seconds() - started) * 1e3;
    *out = (struct cache_value){body, sizeof *body + size, free};
    return TETLOD_OK;
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
    cache_forever(response);
}

enum outcome respond_stored(struct exchange *exchange, struct dataset *dataset, uint64_t offset, uint64_t size,
                            const char *etag)
{
    struct cache *cache = exchange->site->cache;
    enum outcome outcome = ANSWERED;
    if (size > MOST_CACHED || request_header(exchange->request, "Range")) {
        respond_file(exchange, dataset, offset, size, etag);
        return ANSWERED;
    }
    const struct cache_value *value = obtain_cached(exchange, cache, etag);
    struct stored_context *context = value ? NULL : array_new(1, sizeof *context);
    if (context) {
        *context = (struct stored_context){dataset_hold(dataset), offset, size};
        const struct recipe recipe = {read_stored, stored_context_free, context, size};
        outcome = obtain(exchange, cache, etag, &recipe, &value);
    }
    if (value) {
        respond_body(exchange, value, "application/vnd.tetlod", CODING_IDENTITY, etag);
        if (exchange->response->status == 200)
            cache_forever(exchange->response);
    } else if (!context) // no memory for the cache: the file does without
        respond_file(exchange, dataset, offset, size, etag);
    return outcome;
}
