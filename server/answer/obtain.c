/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/obtain.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "format/fail.h"
#include "server/answer/respond.h"
#include "src/util/array.h"
#include "src/util/clock.h"

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

/* ---- the stream in memory ---- */

struct decode {
    struct site *site;
    struct dataset *dataset; /* held */
};

static bool stopping(void *pool)
{
    return pool_stopping(pool);
}

static void decode(void *opaque)
{
    struct decode *decode = opaque;
    uint32_t finest = dataset_info(decode->dataset)->level_count - 1;
    enum tetlod_status status = decoding_run(dataset_decoding(decode->dataset), finest, stopping, decode->site->decoders, NULL);
    if (status == TETLOD_OK)
        metrics_count(decode->site->metrics, METRIC_STREAMS_DECODED);
    dataset_release(decode->dataset);
    free(decode);
}

/* Who asked has been registered as waiting: on failure it is woken and hears why. */
static void start_decoding(struct site *site, struct dataset *dataset)
{
    struct tetlod_error failure = {.status = TETLOD_ERR_LIMIT, .message = "the server has too much to do"};
    struct decode *context = array_new(1, sizeof *context);
    if (context) {
        *context = (struct decode){site, dataset_hold(dataset)};
        if (pool_submit(site->decoders, decode, context))
            return;
        dataset_release(dataset);
        free(context);
    }
    decoding_cancel(dataset_decoding(dataset), &failure);
}

enum outcome obtain_forest(struct exchange *exchange, struct dataset *dataset, uint32_t level, const struct forest **out)
{
    struct request *request = exchange->request;
    struct decoding *decoding = dataset_decoding(dataset);
    bool here = !request->waiter || !exchange->site->decoders;
    struct tetlod_error failure = {0};
    if ((*out = decoding_find(decoding, level)))
        return ANSWERED;
    enum decoding_state state = decoding_ask(decoding, level, request->waited_for_stream, here ? NULL : request->waiter, &failure);
    if (state == DECODING_MINE && here)
        state = decoding_run(decoding, level, NULL, NULL, &failure) == TETLOD_OK ? DECODING_READY : DECODING_FAILED;
    else if (state == DECODING_MINE)
        start_decoding(exchange->site, dataset);
    if (state == DECODING_READY)
        *out = decoding_find(decoding, level);
    else if (state == DECODING_FAILED)
        respond_failure(exchange, &failure);
    else if (here)
        response_problem(exchange->response, 503, request->target, "this stream is being decoded");
    else {
        request->waited = request->waited_for_stream = true;
        return WAITING;
    }
    return ANSWERED;
}
