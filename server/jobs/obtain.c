/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/jobs/obtain.h"

#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/respond.h"
#include "src/stream/forest.h"
#include "src/util/array.h"
#include "src/util/clock.h"

struct run {
    struct site *site;
    struct cache *cache;
    struct cache_entry *entry; /* held */
    struct job job;
    struct workers *workers; /* that runs it; NULL: the asking thread does, which must not wait */
    double until;      /* when it gives up waiting for room */
    struct waiter seeker; /* of room */
    bool counted;         /* among those of its client */
    size_t client;
    struct room room;
    enum tetlod_status refused; /* why the room did not grant the job's bytes, which it raised */
};

enum { KEY_CAPACITY = 80 };

/* Says why there is no room. */
static enum tetlod_status fail_room(struct run *run, enum tetlod_status status, struct tetlod_error *failure)
{
    if (status == TETLOD_ERR_ARGUMENT)
        return tetlodi_fail(failure, status,
                            "needs %llu MB, more than the server may take (--memory, --cache); meshes of a stream in "
                            "pages (tetlod build --paged) need less; the stored bytes (format=tetlod, records, "
                            "stream) are served at any size",
                            (unsigned long long)((run->job.bytes + run->job.beside) >> 20));
    return tetlodi_fail(failure, status, "the server's memory is full of answers that are being read");
}

static void end_job(struct run *run, enum tetlod_status status, const struct cache_value *value,
                    struct tetlod_error *failure)
{
    if (status != TETLOD_OK && !failure->status)
        failure->status = status;
    run->job.free(run->job.context);
    if (run->counted)
        quota_give(&run->site->jobs, run->client);
    cache_finish(run->cache, run->entry, status == TETLOD_OK ? value : NULL, failure);
    cache_release(run->cache, run->entry);
    free(run);
}

bool run_wanted(struct run *run)
{
    return !run->workers || (!workers_stopping(run->workers) && cache_wanted(run->cache, run->entry));
}

enum tetlod_status fail_unwanted(struct tetlod_error *error)
{
    return tetlodi_fail(error, TETLOD_ERR_LIMIT, "the server is stopping, or nobody waits for this any more");
}

struct room *run_room(struct run *run)
{
    return &run->room;
}

static enum tetlod_status reserve(struct run *run)
{
    const uint64_t bytes = run->job.bytes, most = cache_capacity(run->cache);
    if (run->job.beside > most || bytes > most - run->job.beside)
        return TETLOD_ERR_ARGUMENT;
    return cache_reserve(run->cache, run->entry, bytes);
}

static enum tetlod_status grant(struct room *room, uint64_t bytes, struct tetlod_error *error)
{
    struct run *run = (struct run *)(void *)((char *)room - offsetof(struct run, room));
    if (!run_wanted(run))
        return fail_unwanted(error);
    run->job.bytes = bytes;
    run->refused = reserve(run);
    if (run->refused != TETLOD_OK)
        return fail_room(run, run->refused, error);
    room->granted = bytes;
    return TETLOD_OK;
}

/* Makes it in the room that is reserved; false: it needs more, and has nothing. */
static bool make_value(struct run *run)
{
    struct cache_value value = {0};
    struct tetlod_error failure = {0};
    run->room = (struct room){grant, 0, run->job.bytes};
    run->refused = TETLOD_OK;
    enum tetlod_status status = run->job.make(run->job.context, run, &value, &failure);
    if (status != TETLOD_OK && run->refused == TETLOD_ERR_LIMIT &&
        cache_reserve(run->cache, run->entry, 0) == TETLOD_OK)
        return false;
    end_job(run, status, &value, &failure);
    return true;
}

/* Makes room for a value and makes it. What nobody waits for any more is not made. Only what is being made takes room,
 * so that waiting work keeps out nobody; and it waits outside the threads, until readers have let go of enough. */
static void run_job(void *context)
{
    struct run *run = context;
    struct tetlod_error failure = {0};
    if (run->workers && (workers_stopping(run->workers) || cache_drop_unwanted(run->cache, run->entry))) {
        end_job(run, fail_unwanted(&failure), NULL, &failure);
        return;
    }
    enum tetlod_status status = TETLOD_OK;
    while (status == TETLOD_OK) {
        status = reserve(run);
        if (status == TETLOD_OK && make_value(run))
            return;
    }
    bool waits = status == TETLOD_ERR_LIMIT && run->workers && monotonic_seconds() < run->until;
    if (waits)
        cache_seek_room(run->cache, &run->seeker);
    else
        end_job(run, fail_room(run, status, &failure), NULL, &failure);
}

/* There may be room now. Called from whichever thread let go of some: the work goes to its own. */
static void go_on(struct waiter *seeker)
{
    struct run *run = (struct run *)(void *)((char *)seeker - offsetof(struct run, seeker));
    struct tetlod_error failure = {0};
    if (workers_submit(run->workers, run_job, run))
        return;
    if (workers_stopping(run->workers))
        end_job(run, fail_room(run, TETLOD_ERR_LIMIT, &failure), NULL, &failure);
    else
        cache_seek_room(run->cache, seeker); // its queue is full: the next time
}

static void give_up(struct cache *cache, struct cache_entry *entry, const struct job *job,
                    enum tetlod_status status,
                    const char *message)
{
    struct tetlod_error failure = {.status = status};
    snprintf(failure.message, sizeof failure.message, "%s", message);
    job->free(job->context);
    cache_finish(cache, entry, NULL, &failure);
}

/* Reading stored bytes is no job of the client's: it takes no time that others wait for. */
static bool is_counted(const struct site *site, const struct request *request, const struct job *job)
{
    return request->client && request->waiter && site->jobs_per_client && (!job->workers ||
                                                                           job->workers != site->readers);
}

static void start(struct site *site, const struct request *request, struct cache *cache, struct cache_entry *entry,
                  const struct job *job)
{
    bool here = !request->waiter || !site->workers;
    struct run *run = array_new(1, sizeof *run);
    if (!run) {
        give_up(cache, entry, job, TETLOD_ERR_NOMEM, "the server is out of memory");
        return;
    }
    struct workers *workers = job->workers ? job->workers : site->workers;
    *run = (struct run){site, cache, entry, *job, here ? NULL : workers, monotonic_seconds() + job->wait_seconds,
                        {go_on, NULL},
                        is_counted(site, request, job), 0, {NULL, 0, 0}, TETLOD_OK};
    cache_hold(cache, entry);
    if (run->counted) {
        run->client = quota_place(request->client);
        quota_take(&site->jobs, run->client);
    }
    if (here)
        run_job(run);
    else if (!workers_submit(workers, run_job, run)) {
        struct tetlod_error failure = {0};
        end_job(run, tetlodi_fail(&failure, TETLOD_ERR_LIMIT, "the server has too much to do"), NULL, &failure);
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

static bool has_free_pin(const struct request *request)
{
    for (size_t i = 0; i < REQUEST_PINS; i++)
        if (!request->pins[i].entry)
            return true;
    return false;
}

static void add_pin(struct request *request, struct cache *cache, struct cache_entry *entry)
{
    size_t i = 0;
    while (request->pins[i].entry)
        i++;
    request->pins[i].cache = cache;
    request->pins[i].entry = entry;
}

/* The entry of a key, pinned; NULL: answered. Nothing is begun that this request could not hold, or that is one job too
 * many. */
static struct cache_entry *pin_entry(struct exchange *exchange, struct cache *cache, const char *key,
                                     const struct job *job, bool *mine)
{
    struct request *request = exchange->request;
    const struct site *site = exchange->site;
    struct cache_entry *entry = has_free_pin(request) ? cache_find(cache, key) : NULL;
    if (!entry && is_counted(site, request, job) &&
        !quota_has_room(&site->jobs, request->client, (unsigned)site->jobs_per_client)) {
        response_problem(exchange->response, 429, request->target,
                         "%zu answers for this address are being made; ask again when there are fewer",
                         site->jobs_per_client);
        return NULL;
    }
    if (!entry && has_free_pin(request))
        entry = cache_fetch(cache, key, mine);
    if (entry)
        add_pin(request, cache, entry);
    else
        respond_no_memory(exchange);
    return entry;
}

enum outcome obtain(struct exchange *exchange, struct cache *cache, const char *key, const struct job *job,
                    const struct cache_value **out)
{
    struct request *request = exchange->request;
    struct cache_entry *entry = find_pin(request, cache, key);
    struct tetlod_error failure;
    bool mine = false;
    *out = NULL;
    if (!entry && !(entry = pin_entry(exchange, cache, key, job, &mine))) {
        job->free(job->context);
        return ANSWERED;
    }
    request->awaited = entry;
    request->awaited_in = cache;
    /* The waiter is registered before the work starts: from then on the request may be resumed at any time. */
    bool waits = !cache_finished(entry) && request->waiter && cache_wait(cache, entry, request->waiter);
    if (mine)
        start(exchange->site, request, cache, entry, job);
    else
        job->free(job->context);
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
    if (!cache_finished(entry) || !has_free_pin(exchange->request)) {
        cache_release(cache, entry);
        return NULL;
    }
    add_pin(exchange->request, cache, entry);
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

static enum tetlod_status make_forest(void *opaque, struct run *run, struct cache_value *out,
                                      struct tetlod_error *error)
{
    struct decode *decode = opaque;
    struct decoded *decoded = array_zero(1, sizeof *decoded);
    if (!decoded)
        return tetlodi_fail_nomem(error, "a stream in memory", sizeof *decoded);
    decoded->dataset = dataset_hold(decode->dataset);
    decoded->serial = atomic_fetch_add(&decode->site->forests, 1);
    enum tetlod_status status = forest_new(&decoded->forest, dataset_file(decode->dataset), decode->level, error);
    while (status == TETLOD_OK && forest_levels(decoded->forest) <= decode->level)
        status = run_wanted(run) ? forest_grow(decoded->forest, error) : fail_unwanted(error);
    if (status != TETLOD_OK) {
        free_decoded(decoded);
        return status;
    }
    metrics_count(decode->site->metrics, METRIC_STREAMS_DECODED);
    *out = (struct cache_value){decoded, sizeof *decoded + forest_bytes(decoded->forest), free_decoded};
    return TETLOD_OK;
}

static void print_key(const struct dataset *dataset, uint32_t last, char out[static KEY_CAPACITY])
{
    snprintf(out, KEY_CAPACITY, "%s/forest/%" PRIx64 "/%" PRIu32, dataset_info(dataset)->cid,
             dataset_file_number(dataset), last);
}

/* One that is there already and has the level, be it for a finer one. */
static const struct cache_value *find_forest(struct exchange *exchange, const struct dataset *dataset, uint32_t level)
{
    const struct tetlod_info *info = dataset_info(dataset);
    const struct cache_value *value = NULL;
    char key[KEY_CAPACITY];
    for (uint32_t last = level; !value && last < info->level_count; last++) {
        last = forest_last_level(info, last);
        print_key(dataset, last, key);
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
    const struct cache_value *value = find_forest(exchange, dataset, level);
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
        print_key(dataset, forest_last_level(info, level), key);
        const struct job job = {make_forest, free_decode, decode, forest_estimate(info, level), MAX_WAIT_SECONDS,
                                      exchange->site->decoders, 0};
        outcome = obtain(exchange, exchange->site->memory, key, &job, &value);
    }
    if (value)
        *out = obtain_take(exchange->request, value);
    return outcome;
}
