/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/stored.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/answer/obtain.h"
#include "server/answer/respond.h"
#include "src/util/clock.h"

enum {
    MAX_KEPT =
        8 << 20, // bytes that are in the cache while they are sent; what is longer goes through it window by window
    MIN_WINDOW = 64 << 10, // of a range: neighbouring ranges find it
    STEP = 1 << 20,        // window of an answer that goes through the cache
    MAX_KEY = ETAG_CAPACITY + 48,
};

/* A part of an answer. */
struct window {
    uint64_t first, size;
};

/* An answer as spans of a stream, one after the other. */
struct stored {
    struct dataset *dataset; /* held */
    struct window window;    /* that is to be read */
    uint64_t size;           /* of all spans */
    size_t count;
    struct tetlod_span spans[];
};

/* An answer that goes through the cache. */
struct passing {
    struct site *site;
    struct request *request; /* which lasts until the answer is sent */
    struct stored *stored;   /* owned */
    char etag[ETAG_CAPACITY];
};

static struct stored *new_stored(struct dataset *dataset, const struct tetlod_span *spans, size_t count)
{
    struct stored *stored = malloc(sizeof *stored + count * sizeof *spans);
    if (!stored)
        return NULL;
    *stored = (struct stored){dataset_hold(dataset), {0, 0}, 0, count};
    for (size_t i = 0; i < count; i++) {
        stored->spans[i] = spans[i];
        stored->size += spans[i].size;
    }
    return stored;
}

static void free_stored(void *opaque)
{
    struct stored *stored = opaque;
    dataset_release(stored->dataset);
    free(stored);
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
static enum tetlod_status read_window(const struct stored *stored, unsigned char *out, struct tetlod_error *error)
{
    uint64_t begin = stored->window.first, left = stored->window.size;
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

static enum tetlod_status make_window(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct stored *stored = opaque;
    double started = monotonic_seconds();
    struct buffer buffer = {0};
    unsigned char *place = buffer_extend(&buffer, (size_t)stored->window.size);
    enum tetlod_status status =
        place ? read_window(stored, place, error) : tetlodi_fail_nomem(error, "stored bytes", stored->window.size);
    if (status == TETLOD_OK)
        status = body_take(&buffer, started, started, out, error);
    else if (place)
        status = fail_read(stored, status, error);
    buffer_fini(&buffer);
    return status;
}

static void print_key(char out[static MAX_KEY], const char *etag, const struct window *window, uint64_t size)
{
    if (window->size == size)
        snprintf(out, MAX_KEY, "%s", etag);
    else
        snprintf(out, MAX_KEY, "%s/%" PRIu64 "+%" PRIu64, etag, window->first, window->size);
}

static enum outcome obtain_window(struct exchange *exchange, const struct stored *stored, const struct window *window,
                                  const char *etag, const struct cache_value **out)
{
    struct site *site = exchange->site;
    uint64_t bytes = window->size + 4096;
    struct cache *cache = cache_for(site, bytes);
    char key[MAX_KEY];
    print_key(key, etag, window, stored->size);
    *out = obtain_cached(exchange, cache, key);
    if (*out)
        return ANSWERED;
    if (dataset_hangs(stored->dataset))
        return respond_hanging(exchange, stored->dataset);
    struct stored *reading = new_stored(stored->dataset, stored->spans, stored->count);
    if (!reading)
        return respond_no_memory(exchange);
    reading->window = *window;
    double patience = window->size > STEP ? 0 : PATIENCE; // what is larger can do without
    const struct recipe recipe = {make_window, free_stored, reading, bytes, patience, site->readers};
    return obtain(exchange, cache, key, &recipe, out);
}

/* ---- answers that go through the cache */

static void free_passing(void *opaque)
{
    struct passing *passing = opaque;
    free_stored(passing->stored);
    free(passing);
}

static struct window step_at(uint64_t begin, uint64_t size)
{
    uint64_t first = begin / STEP * STEP;
    return (struct window){first, size - first < STEP ? size - first : STEP};
}

/* Copies what is there. */
static ptrdiff_t read_passing(void *opaque, uint64_t begin, size_t size, unsigned char *out)
{
    struct passing *passing = opaque;
    struct window window = step_at(begin, passing->stored->size);
    struct response unsent;
    struct exchange exchange = {.site = passing->site, .request = passing->request, .response = &unsent};
    const struct cache_value *value;
    response_init(&unsent);
    if (obtain_window(&exchange, passing->stored, &window, passing->etag, &value) == WAITING)
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

/* The first window is there before the answer begins: where that fails, the client gets a refusal. Takes over *stored
 * with 200. */
static enum outcome respond_passing(struct exchange *exchange, struct stored **taken, uint64_t first,
                                    const struct representation *representation)
{
    struct stored *stored = *taken;
    struct window window = step_at(first, stored->size);
    const struct cache_value *value;
    enum outcome outcome = obtain_window(exchange, stored, &window, representation->etag, &value);
    if (!value)
        return outcome;
    struct passing *passing = malloc(sizeof *passing);
    if (!passing)
        return respond_no_memory(exchange);
    *taken = NULL;
    *passing = (struct passing){.site = exchange->site, .request = exchange->request, .stored = stored};
    snprintf(passing->etag, sizeof passing->etag, "%s", representation->etag);
    response_pieces(exchange->response, representation->media_type, stored->size, read_passing, free_passing, passing);
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
    const struct cache_value *value = obtain_cached(exchange, exchange->site->cache, representation->etag);
    uint64_t held = value ? 0 : window->first; // the whole answer may be there
    enum outcome outcome = value ? ANSWERED : obtain_window(exchange, stored, window, representation->etag, &value);
    if (!value)
        return outcome;
    respond_body(exchange, value, representation);
    exchange->response->held = held;
    exchange->response->size = stored->size;
    return ANSWERED;
}

/* Answers with the range that the request chooses. What is taken over of *stored is NULL afterwards. */
static enum outcome respond_bytes(struct exchange *exchange, struct stored **stored,
                                  const struct representation *representation)
{
    const struct site *site = exchange->site;
    uint64_t size = (*stored)->size, first = 0, length = size;
    enum range_result range = request_range(exchange->request, exchange->response->etag, size, &first, &length);
    if (range == RANGE_UNSATISFIABLE || exchange->request->method == METHOD_HEAD) {
        respond_absent(exchange->response, size);
        return ANSWERED;
    }
    struct window window = length == size ? (struct window){0, size} : window_of(first, length, size);
    if (length <= MAX_KEPT && (window.size <= STEP || window.size <= cache_capacity(site->cache) / 8)) {
        enum outcome outcome = respond_kept(exchange, *stored, &window, representation);
        if (outcome == WAITING || exchange->response->status == 200 || window.size <= STEP ||
            dataset_damaged((*stored)->dataset))
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
    struct stored *stored = new_stored(dataset, spans, count);
    enum outcome outcome = ANSWERED;
    if (!stored)
        return respond_no_memory(exchange);
    if (!respond_unchanged(exchange, &representation, stored->size)) {
        respond_representation(exchange->response, &representation);
        outcome = respond_bytes(exchange, &stored, &representation);
    }
    if (stored)
        free_stored(stored);
    return outcome;
}
