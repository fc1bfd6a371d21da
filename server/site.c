/* SPDX-License-Identifier: BSD-3-Clause */
/* From a request to its handler and back: routes, conditions, ranges, and values that are made once. */
#include "server/site.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>

#include "format/fail.h"
#include "src/util/array.h"

const struct route site_routes[] = {
    {"/healthz", handle_health},
    {"/readyz", handle_ready},
    {"/metrics", handle_metrics},
    {"/view/{id}", handle_view},
    {"/v1/meshes", handle_catalogue},
    {"/v1/meshes/{id}", handle_stream_info},
    {"/v1/meshes/{id}/mesh", handle_mesh},
    {"/v1/meshes/{id}/prefix", handle_prefix},
    {"/v1/meshes/{id}/{cid}/stream", handle_stream},
    {"/v1/meshes/{id}/{cid}/records/{from}-{to}", handle_records},
    {"/v1/meshes/{id}/{cid}/levels/{level}/mesh.{format}", handle_level_mesh},
    {"/v1/meshes/{id}/{cid}/levels/{level}/surface.{format}", handle_surface},
    {"/v1/meshes/{id}/{cid}/levels/{level}/isosurface.{format}", handle_isosurface},
    {"/v1/meshes/{id}/{cid}/levels/{level}/slice.{format}", handle_slice},
    {NULL, NULL},
};

static const char page_route[] = "/"; // the page and the files that it loads

static const char allow[] = "GET, HEAD, OPTIONS";

double monotonic_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

void cache_forever(struct response *response)
{
    response_header_text(response, "Cache-Control", "public, max-age=31536000, immutable, no-transform");
}

void cache_revalidate(struct response *response)
{
    response_header_text(response, "Cache-Control", "no-cache");
}

/* Matches a path, not decoded, with a template. Captures are decoded afterwards, so that an encoded '/' or '.' is data. */
static bool match(const char *template, const char *path, size_t size, char captures[CAPTURES][CAPTURE_CAPACITY])
{
    const char *end = path + size;
    for (size_t count = 0; *template;) {
        if (*template != '{') {
            if (path == end || *path++ != *template++)
                return false;
            continue;
        }
        template = strchr(template, '}') + 1;
        const char *start = path;
        while (path < end && *path != '/' && (!*template || *path != *template))
            path++;
        if (path == start || !percent_decode(start, (size_t)(path - start), captures[count++], CAPTURE_CAPACITY))
            return false;
    }
    return path == end;
}

/* The path of a request target: absolute form ("http://host/path", which RFC 9112 obliges servers to take) loses its front. */
static const char *path_of(const char *target)
{
    if (strncasecmp(target, "http://", 7) != 0 && strncasecmp(target, "https://", 8) != 0)
        return target;
    const char *authority = strstr(target, "//") + 2;
    size_t size = strcspn(authority, "/?");
    return authority[size] == '/' ? authority + size : "/";
}

static enum outcome dispatch(struct exchange *exchange, const char *path)
{
    struct response *response = exchange->response;
    size_t size = strcspn(path, "?");
    exchange->query = path[size] ? path + size + 1 : NULL;
    for (const struct route *route = site_routes; route->template; route++)
        if (match(route->template, path, size, exchange->captures)) {
            response->route = route->template;
            return route->handle(exchange);
        }
    const struct embedded_file *asset =
        percent_decode(path, size, exchange->captures[0], CAPTURE_CAPACITY) ? assets_find(exchange->captures[0]) : NULL;
    if (asset) {
        response->route = page_route;
        return handle_asset(exchange, asset);
    }
    response_problem(response, 404, exchange->request->target,
                     "there is nothing under this path; /openapi.json lists what there is");
    return ANSWERED;
}

static void answer_options(struct response *response)
{
    response->status = 204;
    response_header_text(response, "Allow", allow);
    response_header_text(response, "Access-Control-Allow-Methods", allow);
    response_header_text(response, "Access-Control-Allow-Headers", "Range, If-Range, If-None-Match, If-Modified-Since, Accept-Encoding");
    response_header_text(response, "Access-Control-Max-Age", "86400");
}

/* If-None-Match and Range (RFC 9110, 13.2.2) on an answer of 200. */
static void apply_conditions(const struct request *request, struct response *response)
{
    uint64_t first, length;
    const char *if_range = request_header(request, "If-Range");
    if (response->etag[0] && etag_list_has(request_header(request, "If-None-Match"), response->etag)) {
        response->status = 304; // the body stays: http.c needs its size
        return;
    }
    if (!response->ranges)
        return;
    response_header_text(response, "Accept-Ranges", "bytes");
    if (request->method != METHOD_GET || (if_range && !etag_same(if_range, response->etag)))
        return;
    uint64_t size = response->size;
    switch (range_parse(request_header(request, "Range"), size, &first, &length)) {
    case RANGE_IGNORED:
        return;
    case RANGE_UNSATISFIABLE:
        response_release(response);
        response_problem(response, 416, request->target, "the range lies outside the %llu bytes", (unsigned long long)size);
        response_header(response, "Content-Range", "bytes */%llu", (unsigned long long)size);
        return;
    case RANGE_OK:
        response->status = 206;
        response_header(response, "Content-Range", "bytes %llu-%llu/%llu", (unsigned long long)first,
                        (unsigned long long)(first + length - 1), (unsigned long long)size);
        response->size = length;
        if (response->kind == BODY_FILE)
            response->offset += first;
        else
            response->bytes = (const unsigned char *)response->bytes + first;
    }
}

enum outcome site_answer(struct site *site, struct request *request, struct response *response)
{
    struct exchange exchange = {.site = site, .request = request, .response = response};
    const char *path = path_of(request->target);
    enum outcome outcome = ANSWERED;
    if (request->refused && request->refused != 413) {
        response_problem(response, request->refused, request->target, "%s", request->why_refused);
        response->close = true;
    } else if (request->method == METHOD_OTHER) {
        response_problem(response, 405, request->target, "only %s are answered here", allow);
        response_header_text(response, "Allow", allow);
        response->close = true; // what follows might be a body that nobody reads
    } else if (request->refused) {
        response_problem(response, request->refused, request->target, "%s", request->why_refused);
        response->close = true;
    } else if (request->method == METHOD_OPTIONS)
        answer_options(response);
    else
        outcome = dispatch(&exchange, path);
    if (outcome == WAITING) {
        response_release(response);
        return WAITING;
    }
    if (response->status == 200 && (request->method == METHOD_GET || request->method == METHOD_HEAD))
        apply_conditions(request, response);
    return ANSWERED;
}

/* ---- values that are made once ---- */

struct task {
    struct cache *cache;
    struct cache_entry *entry; /* held */
    struct recipe recipe;
    struct pool *pool; /* that runs it; NULL: the asking thread does, which must not wait */
    double until;      /* when it gives up waiting for room */
};

static const struct timespec PAUSE = {0, 5000000};

/* Makes room for a value, if need be when readers have let go of others. */
static enum tetlod_status reserve(const struct task *task)
{
    enum tetlod_status status;
    while ((status = cache_reserve(task->cache, task->entry, task->recipe.bytes)) == TETLOD_ERR_LIMIT && task->pool &&
           !pool_stopping(task->pool) && monotonic_seconds() < task->until)
        nanosleep(&PAUSE, NULL);
    return status;
}

/* Makes room for a value and makes it. Only what is being made takes room, so that waiting work keeps out nobody. */
static enum tetlod_status make_in_room(const struct task *task, struct cache_value *value, struct tetlod_error *failure)
{
    switch (reserve(task)) {
    case TETLOD_OK:
        return task->recipe.make(task->recipe.context, value, failure);
    case TETLOD_ERR_ARGUMENT:
        return tetlodi_fail(failure, TETLOD_ERR_ARGUMENT, "needs more memory than the server's cache has; the stored bytes "
                                                          "(format=tetlod, records, stream) are served at any size");
    default:
        return tetlodi_fail(failure, TETLOD_ERR_LIMIT, "the server's cache is full of answers that are being read");
    }
}

static void run_task(void *context)
{
    struct task *task = context;
    struct cache_value value = {0};
    struct tetlod_error failure = {0};
    enum tetlod_status status = make_in_room(task, &value, &failure);
    if (status != TETLOD_OK && !failure.status)
        failure.status = status;
    task->recipe.free(task->recipe.context);
    cache_finish(task->cache, task->entry, status == TETLOD_OK ? &value : NULL, &failure);
    cache_release(task->cache, task->entry);
    free(task);
}

static void give_up(struct cache *cache, struct cache_entry *entry, const struct recipe *recipe, enum tetlod_status status,
                    const char *message)
{
    struct tetlod_error failure = {.status = status};
    snprintf(failure.message, sizeof failure.message, "%s", message);
    recipe->free(recipe->context);
    cache_finish(cache, entry, NULL, &failure);
}

static void start(struct site *site, struct cache *cache, struct cache_entry *entry, const struct recipe *recipe,
                  bool here)
{
    struct task *task = array_new(1, sizeof *task);
    if (!task) {
        give_up(cache, entry, recipe, TETLOD_ERR_NOMEM, "the server is out of memory");
        return;
    }
    *task = (struct task){cache, entry, *recipe, here ? NULL : site->pool, monotonic_seconds() + recipe->patience};
    cache_hold(cache, entry);
    if (here)
        run_task(task);
    else if (!pool_submit(site->pool, run_task, task)) {
        cache_release(cache, entry);
        free(task);
        give_up(cache, entry, recipe, TETLOD_ERR_LIMIT, "the server has too much to do");
    }
}

static struct cache_entry *find_pin(struct request *request, const struct cache *cache, const char *key)
{
    for (size_t i = 0; i < REQUEST_PINS; i++)
        if (request->pins[i].entry && request->pins[i].cache == cache &&
            strcmp(cache_key(request->pins[i].entry), key) == 0)
            return request->pins[i].entry;
    return NULL;
}

static bool add_pin(struct request *request, struct cache *cache, struct cache_entry *entry)
{
    for (size_t i = 0; i < REQUEST_PINS; i++)
        if (!request->pins[i].entry) {
            request->pins[i].cache = cache;
            request->pins[i].entry = entry;
            return true;
        }
    return false;
}

enum outcome obtain(struct exchange *exchange, struct cache *cache, const char *key, const struct recipe *recipe,
                    const struct cache_value **out)
{
    struct request *request = exchange->request;
    struct cache_entry *entry = find_pin(request, cache, key);
    struct tetlod_error failure;
    bool mine = false;
    *out = NULL;
    if (!entry) {
        entry = cache_fetch(cache, key, &mine);
        if (!entry || !add_pin(request, cache, entry)) {
            cache_release(cache, entry);
            recipe->free(recipe->context);
            response_problem(exchange->response, 503, request->target, "the server is out of memory");
            return ANSWERED;
        }
    }
    /* The waiter is registered before the work starts: from then on the request may be resumed at any time. */
    bool waits = !cache_finished(entry) && request->waiter && cache_wait(cache, entry, request->waiter);
    if (mine)
        start(exchange->site, cache, entry, recipe, !request->waiter || !exchange->site->pool);
    else
        recipe->free(recipe->context);
    if (waits) {
        request->waited = true;
        return WAITING;
    }
    if (!cache_finished(entry)) { // only for a caller without waiter
        response_problem(exchange->response, 503, request->target, "this answer is being made");
        return ANSWERED;
    }
    *out = cache_value(entry, &failure);
    if (!*out)
        respond_failure(exchange, &failure);
    return ANSWERED;
}

const struct cache_value *obtain_cached(struct exchange *exchange, struct cache *cache, const char *key)
{
    struct tetlod_error ignored;
    struct cache_entry *entry = find_pin(exchange->request, cache, key);
    if (entry) // it was waited for, or is still coming
        return cache_finished(entry) ? cache_value(entry, &ignored) : NULL;
    entry = cache_find(cache, key);
    if (!entry)
        return NULL;
    if (!cache_finished(entry) || !add_pin(exchange->request, cache, entry)) {
        cache_release(cache, entry);
        return NULL;
    }
    return cache_value(entry, &ignored);
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
    *body = (struct body){buffer->size, (extracted - started) * 1e3, (monotonic_seconds() - started) * 1e3, buffer->bytes};
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

static void respond_representation(struct response *response, const struct representation *representation)
{
    enum coding coding = representation->coding;
    response->status = 200;
    response->media_type = representation->media_type;
    response->ranges = coding == CODING_IDENTITY;
    print_etag(representation, response->etag);
    if (coding)
        response_header_text(response, "Content-Encoding", coding_name(coding));
    if (!representation->alone)
        response_header_text(response, "Vary", "Accept-Encoding");
}

void respond_body(struct exchange *exchange, const struct cache_value *value, const struct representation *representation)
{
    struct response *response = exchange->response;
    const struct body *body = value->data; // pinned by the request
    respond_representation(response, representation);
    response->kind = BODY_BYTES;
    response->bytes = body->bytes;
    response->size = body->size;
    response_header(response, "Server-Timing", "cache;desc=%s, extract;dur=%.2f, make;dur=%.2f",
                    exchange->request->waited ? "miss" : "hit", body->extract, body->make);
}

bool respond_unchanged(struct exchange *exchange, const struct representation *representation, uint64_t size)
{
    struct response *response = exchange->response;
    char etag[ETAG_CAPACITY];
    print_etag(representation, etag);
    if (!etag_list_has(request_header(exchange->request, "If-None-Match"), etag))
        return false;
    respond_representation(response, representation);
    response->kind = BODY_ABSENT;
    response->size = size;
    return true;
}

void respond_failure(struct exchange *exchange, const struct tetlod_error *error)
{
    const char *message = error->message[0] ? error->message : tetlod_status_text(error->status);
    bool later = error->status == TETLOD_ERR_NOMEM || error->status == TETLOD_ERR_LIMIT;
    unsigned status = later                                 ? 503
                      : error->status == TETLOD_ERR_ARGUMENT ? 422  // more than the cache may hold
                      : error->status == TETLOD_ERR_MISMATCH ? 404  // the file is another one
                                                             : 500;
    response_problem(exchange->response, status, exchange->request->target, "%s", message);
}
