/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/jobs/stored.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/conditions.h"
#include "server/http/respond.h"
#include "server/jobs/obtain.h"
#include "src/util/clock.h"

enum {
    MAX_KEPT =
        8 << 20, // bytes that are in the cache while they are sent; what is longer goes through it window by window
    MIN_WINDOW = 64 << 10, // of a range: neighbouring ranges find it
    STEP = 1 << 20,        // window of an answer that goes through the cache
    MAX_KEY = ETAG_CAPACITY + 64,
};

/* A part of an answer. */
struct window {
    uint64_t first, size;
};

/* Spans of a stream, one after the other. All is borrowed. */
struct stored {
    struct dataset *dataset;
    const struct tetlod_span *spans;
    size_t count;
    uint64_t size; /* of all spans */
    const char *etag;
};

/* The same for work that goes on without the one who asked for it: its dataset is held, the rest copied. */
struct lasting {
    struct stored stored;
    struct window window; /* to be read by a worker */
    struct site *site;    /* of an answer that goes through the cache, and its request, which lasts until it is sent */
    struct request *request;
    char etag[ETAG_CAPACITY];
    struct tetlod_span spans[];
};

static struct lasting *new_lasting(const struct stored *stored)
{
    struct lasting *lasting = malloc(sizeof *lasting + stored->count * sizeof *stored->spans);
    if (!lasting)
        return NULL;
    snprintf(lasting->etag, sizeof lasting->etag, "%s", stored->etag);
    memcpy(lasting->spans, stored->spans, stored->count * sizeof *stored->spans);
    lasting->stored = *stored;
    lasting->stored.dataset = dataset_hold(stored->dataset);
    lasting->stored.spans = lasting->spans;
    lasting->stored.etag = lasting->etag;
    return lasting;
}

static void free_lasting(void *opaque)
{
    struct lasting *lasting = opaque;
    dataset_release(lasting->stored.dataset);
    free(lasting);
}

/* ---- a window's bytes */

/* Says whose bytes are not to be had, and what the client may do. */
static enum tetlod_status fail_read(const struct stored *stored, enum tetlod_status status, struct tetlod_error *error)
{
    const char *id = dataset_id(stored->dataset);
    char why[sizeof error->message];
    snprintf(why, sizeof why, "%s", error->message);
    if (status == TETLOD_ERR_MISMATCH)
        return tetlodi_fail(error, status, "the file of '%s' was replaced; ask v1/meshes/%s for its content id", id,
                            id);
    return tetlodi_fail(error, status,
                        "the file of '%s' is damaged or is being written (%.120s); try again, or ask v1/meshes/%s for "
                        "another content id",
                        id, why, id);
}

/* Reads the window. */
static enum tetlod_status read_window(const struct stored *stored, const struct window *window, unsigned char *out,
                                      struct tetlod_error *error)
{
    uint64_t begin = window->first, left = window->size;
    for (size_t i = 0; left && i < stored->count; i++) {
        const struct tetlod_span *span = &stored->spans[i];
        if (begin >= span->size) {
            begin -= span->size;
            continue;
        }
        uint64_t some = span->size - begin < left ? span->size - begin : left;
        TETLOD_TRY(dataset_read(stored->dataset, span->offset + begin, out, (size_t)some, error));
        begin = 0;
        out += some;
        left -= some;
    }
    return TETLOD_OK;
}

static enum tetlod_status make_window(void *opaque, struct run *run, struct cache_value *out,
                                      struct tetlod_error *error)
{
    const struct lasting *lasting = opaque;
    (void)run;
    double started = monotonic_seconds();
    struct buffer buffer = {0};
    unsigned char *place = buffer_extend(&buffer, (size_t)lasting->window.size);
    enum tetlod_status status = TETLOD_ERR_NOMEM;
    if (!place)
        status = tetlodi_fail_nomem(error, "stored bytes", lasting->window.size);
    else if ((status = read_window(&lasting->stored, &lasting->window, place, error)) == TETLOD_OK)
        status = body_take(&buffer, started, started, out, error);
    else
        status = fail_read(&lasting->stored, status, error);
    buffer_fini(&buffer);
    return status;
}

static const char *key_of(const struct stored *stored, const struct window *window, char out[static MAX_KEY])
{
    snprintf(out, MAX_KEY, "%s/%" PRIx64 "/%" PRIu64 "+%" PRIu64, stored->etag, dataset_file_number(stored->dataset),
             window->first, window->size);
    return out;
}

static enum outcome obtain_window(struct exchange *exchange, const struct stored *stored, const struct window *window,
                                  const struct cache_value **out)
{
    struct site *site = exchange->site;
    uint64_t bytes = window->size + 4096;
    struct cache *cache = cache_for(site, bytes);
    char text[MAX_KEY];
    const char *key = key_of(stored, window, text);
    *out = obtain_cached(exchange, cache, key);
    if (*out)
        return ANSWERED;
    if (dataset_hangs(stored->dataset))
        return respond_hanging(exchange, stored->dataset);
    struct lasting *reading = new_lasting(stored);
    if (!reading)
        return respond_no_memory(exchange);
    reading->window = *window;
    double wait_seconds = window->size > STEP ? 0 : MAX_WAIT_SECONDS; // what is larger can do without
    const struct job job = {make_window, free_lasting, reading, bytes, wait_seconds, site->readers, 0};
    return obtain(exchange, cache, key, &job, out);
}

/* ---- answers that go through the cache */

static struct window step_at(uint64_t begin, uint64_t size)
{
    uint64_t first = begin / STEP * STEP;
    return (struct window){first, size - first < STEP ? size - first : STEP};
}

/* Copies what is there. */
static ptrdiff_t read_passing(void *opaque, uint64_t begin, size_t size, unsigned char *out)
{
    struct lasting *passing = opaque;
    struct window window = step_at(begin, passing->stored.size);
    struct response unsent;
    struct exchange exchange = {.site = passing->site, .request = passing->request, .response = &unsent};
    const struct cache_value *value;
    response_init(&unsent);
    if (obtain_window(&exchange, &passing->stored, &window, &value) == WAITING)
        return 0;
    if (!value) { // the header is gone: it is too late for a refusal
        response_release(&unsent);
        return -1;
    }
    uint64_t left = window.first + window.size - begin;
    size_t some = left < size ? (size_t)left : size;
    memcpy(out, ((const struct body *)value->data)->bytes + (begin - window.first), some);
    cache_release(cache_for(passing->site, window.size + 4096), obtain_take(passing->request, value));
    return (ptrdiff_t)some;
}

/* The first window is there before the answer begins: where that fails, the client gets a refusal. */
static enum outcome respond_passing(struct exchange *exchange, const struct stored *stored, uint64_t first,
                                    const struct representation *representation)
{
    struct window window = step_at(first, stored->size);
    const struct cache_value *value;
    enum outcome outcome = obtain_window(exchange, stored, &window, &value);
    if (!value)
        return outcome;
    struct lasting *passing = new_lasting(stored);
    if (!passing)
        return respond_no_memory(exchange);
    passing->site = exchange->site;
    passing->request = exchange->request;
    response_pieces(exchange->response, representation->media_type, stored->size, read_passing, free_lasting, passing);
    respond_representation(exchange->response, representation);
    return ANSWERED;
}

/* ---- */

/* The window that a range is sent from. Ranges of about the same place share it. */
static struct window window_of(uint64_t first, uint64_t length, uint64_t size)
{
    uint64_t unit = MIN_WINDOW;
    while (unit < length)
        unit *= 2;
    uint64_t begin = first / unit * unit;
    return (struct window){begin, size - begin < 2 * unit ? size - begin : 2 * unit};
}

/* Answers from the cache. Not with 200 if it has no room for the window now, or what is wrong lies with the file. */
static enum outcome respond_kept(struct exchange *exchange, const struct stored *stored, const struct window *window,
                                 const struct representation *representation)
{
    struct window held = {0, stored->size}; // the whole answer may be there
    char whole[MAX_KEY];
    const struct cache_value *value = obtain_cached(exchange, exchange->site->cache, key_of(stored, &held, whole));
    if (!value) {
        held = *window;
        enum outcome outcome = obtain_window(exchange, stored, window, &value);
        if (!value)
            return outcome;
    }
    respond_body(exchange, value, representation);
    exchange->response->held = held.first;
    exchange->response->size = stored->size;
    return ANSWERED;
}

/* Answers with the range that the request chooses. */
static enum outcome respond_bytes(struct exchange *exchange, const struct stored *stored,
                                  const struct representation *representation)
{
    uint64_t size = stored->size, first = 0, length = size;
    enum range_result range = request_range(exchange->request, exchange->response->etag, size, &first, &length);
    if (range == RANGE_UNSATISFIABLE || exchange->request->method == METHOD_HEAD) {
        respond_absent(exchange->response, size);
        return ANSWERED;
    }
    struct window window = length == size ? (struct window){0, size} : window_of(first, length, size);
    if (length <= MAX_KEPT && (window.size <= STEP || window.size <= cache_capacity(exchange->site->cache) / 8)) {
        enum outcome outcome = respond_kept(exchange, stored, &window, representation);
        if (outcome == WAITING || exchange->response->status == 200 || window.size <= STEP ||
            dataset_damaged(stored->dataset))
            return outcome;
        response_release(exchange->response); // there is no room for so much; step by step it may be
        respond_representation(exchange->response, representation);
    }
    return respond_passing(exchange, stored, first, representation);
}

enum outcome respond_stored(struct exchange *exchange, struct dataset *dataset, const struct tetlod_span *spans,
                            size_t count, const char *etag)
{
    const struct representation representation = {.media_type = "application/vnd.tetlod", .etag = etag, .alone = true};
    struct stored stored = {dataset, spans, count, 0, etag};
    for (size_t i = 0; i < count; i++)
        stored.size += spans[i].size;
    if (respond_unchanged(exchange, &representation, stored.size))
        return ANSWERED;
    respond_representation(exchange->response, &representation);
    return respond_bytes(exchange, &stored, &representation);
}
