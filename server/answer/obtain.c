/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/obtain.h"

#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/answer/respond.h"
#include "src/forest/forest.h"
#include "src/util/array.h"
#include "src/util/clock.h"

struct task {
    struct cache *cache;
    struct cache_entry *entry; /* held */
    struct recipe recipe;
    struct pool *pool; /* that runs it; NULL: the asking thread does, which must not wait */
    double until;      /* when it gives up waiting for room */
    struct waiter seeker; /* of room */
};

enum { KEY_CAPACITY = 80 };

/* Says why there is no room. */
static enum tetlod_status fail_room(const struct task *task, enum tetlod_status status, struct tetlod_error *failure)
{
    if (status == TETLOD_ERR_ARGUMENT)
        return tetlodi_fail(failure, status, "needs %llu MB, more than the server may take (--memory, --cache); the stored bytes "
                                             "(format=tetlod, records, stream) are served at any size",
                            (unsigned long long)(task->recipe.bytes >> 20));
    return tetlodi_fail(failure, status, "the server's memory is full of answers that are being read");
}

static void end_task(struct task *task, enum tetlod_status status, const struct cache_value *value, struct tetlod_error *failure)
{
    if (status != TETLOD_OK && !failure->status)
        failure->status = status;
    task->recipe.free(task->recipe.context);
    cache_finish(task->cache, task->entry, status == TETLOD_OK ? value : NULL, failure);
    cache_release(task->cache, task->entry);
    free(task);
}

/* Makes room for a value and makes it. Only what is being made takes room, so that waiting work keeps out nobody; and it waits
 * outside the threads, until readers have let go of enough. */
static void run_task(void *context)
{
    struct task *task = context;
    struct cache_value value = {0};
    struct tetlod_error failure = {0};
    enum tetlod_status status = cache_reserve(task->cache, task->entry, task->recipe.bytes);
    bool waits = status == TETLOD_ERR_LIMIT && task->pool && !pool_stopping(task->pool) && monotonic_seconds() < task->until;
    if (waits)
        cache_seek_room(task->cache, &task->seeker);
    else if (status == TETLOD_OK)
        end_task(task, task->recipe.make(task->recipe.context, &value, &failure), &value, &failure);
    else
        end_task(task, fail_room(task, status, &failure), NULL, &failure);
}

/* There may be room now. Called from whichever thread let go of some: the work goes to its own. */
static void go_on(struct waiter *seeker)
{
    struct task *task = (struct task *)(void *)((char *)seeker - offsetof(struct task, seeker));
    struct tetlod_error failure = {0};
    if (pool_submit(task->pool, run_task, task))
        return;
    if (pool_stopping(task->pool))
        end_task(task, fail_room(task, TETLOD_ERR_LIMIT, &failure), NULL, &failure);
    else
        cache_seek_room(task->cache, seeker); // its queue is full: the next time
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
    struct pool *pool = recipe->pool ? recipe->pool : site->pool;
    *task = (struct task){cache, entry, *recipe, here ? NULL : pool, monotonic_seconds() + recipe->patience, {go_on, NULL}};
    cache_hold(cache, entry);
    if (here)
        run_task(task);
    else if (!pool_submit(pool, run_task, task)) {
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
            return respond_no_memory(exchange);
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
    uint32_t level;
};

/* A decoded stream, which needs its file. */
struct decoded {
    struct forest *forest;
    struct dataset *dataset; /* held */
    uint64_t serial;
};

static void free_decode(void *opaque)
{
    struct decode *decode = opaque;
    dataset_release(decode->dataset);
    free(decode);
}

static void free_decoded(void *opaque)
{
    struct decoded *decoded = opaque;
    forest_free(decoded->forest);
    dataset_release(decoded->dataset);
    free(decoded);
}

static enum tetlod_status make_forest(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct decode *decode = opaque;
    struct decoded *decoded = array_zero(1, sizeof *decoded);
    struct pool *pool = decode->site->decoders;
    if (!decoded)
        return tetlodi_fail_nomem(error, "a stream in memory", sizeof *decoded);
    decoded->dataset = dataset_hold(decode->dataset);
    decoded->serial = atomic_fetch_add(&decode->site->forests, 1);
    enum tetlod_status status = forest_new(&decoded->forest, dataset_file(decode->dataset), decode->level, error);
    while (status == TETLOD_OK && forest_levels(decoded->forest) <= decode->level)
        status = pool && pool_stopping(pool) ? tetlodi_fail(error, TETLOD_ERR_LIMIT, "the server is stopping") : forest_grow(decoded->forest, error);
    if (status != TETLOD_OK) {
        free_decoded(decoded);
        return status;
    }
    metrics_count(decode->site->metrics, METRIC_STREAMS_DECODED);
    *out = (struct cache_value){decoded, sizeof *decoded + forest_bytes(decoded->forest), free_decoded};
    return TETLOD_OK;
}

static void print_key(const struct tetlod_info *info, uint32_t last, char out[static KEY_CAPACITY])
{
    snprintf(out, KEY_CAPACITY, "%s/forest/%" PRIu32, info->cid, last);
}

/* One that is there already and has the level, be it for a finer one. */
static const struct cache_value *find_forest(struct exchange *exchange, const struct tetlod_info *info, uint32_t level)
{
    const struct cache_value *value = NULL;
    char key[KEY_CAPACITY];
    for (uint32_t last = level; !value && last < info->level_count; last++) {
        last = forest_last_level(info, last);
        print_key(info, last, key);
        value = obtain_cached(exchange, exchange->site->memory, key);
    }
    return value;
}

struct cache_entry *obtain_take(struct request *request, const struct cache_value *value)
{
    for (size_t i = 0; i < REQUEST_PINS; i++) {
        struct cache_entry *entry = request->pins[i].entry;
        struct tetlod_error ignored;
        if (entry && cache_finished(entry) && cache_value(entry, &ignored) == value) {
            request->pins[i].entry = NULL;
            return entry;
        }
    }
    return NULL;
}

uint64_t forest_serial(const struct cache_entry *entry)
{
    struct tetlod_error ignored;
    return ((const struct decoded *)cache_value(entry, &ignored)->data)->serial;
}

const struct forest *forest_of(const struct cache_entry *entry)
{
    struct tetlod_error ignored;
    return ((const struct decoded *)cache_value(entry, &ignored)->data)->forest;
}

enum outcome obtain_forest(struct exchange *exchange, struct dataset *dataset, uint32_t level, struct cache_entry **out)
{
    const struct tetlod_info *info = dataset_info(dataset);
    const struct cache_value *value = find_forest(exchange, info, level);
    enum outcome outcome = ANSWERED;
    *out = NULL;
    if (!value && dataset_hangs(dataset))
        return respond_hanging(exchange, dataset);
    if (!value) {
        struct decode *decode = array_new(1, sizeof *decode);
        char key[KEY_CAPACITY];
        if (!decode)
            return respond_no_memory(exchange);
        *decode = (struct decode){exchange->site, dataset_hold(dataset), level};
        print_key(info, forest_last_level(info, level), key);
        const struct recipe recipe = {make_forest, free_decode, decode, forest_estimate(info, level), PATIENCE, exchange->site->decoders};
        outcome = obtain(exchange, exchange->site->memory, key, &recipe, &value);
    }
    if (value)
        *out = obtain_take(exchange->request, value);
    return outcome;
}
