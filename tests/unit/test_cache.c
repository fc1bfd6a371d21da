/* SPDX-License-Identifier: BSD-3-Clause */
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "server/store/cache.h"
#include "tests/test.h"

static int freed;

static void count_free(void *data)
{
    freed++;
    free(data);
}

/* Fetches and, if it is ours, makes a value of so many bytes. Returns the entry, held. */
static struct cache_entry *make(struct cache *cache, const char *key, size_t size, enum tetlod_status *out)
{
    bool mine;
    struct cache_entry *entry = cache_fetch(cache, key, &mine);
    *out = TETLOD_OK;
    if (!mine)
        return entry;
    *out = cache_reserve(cache, entry, size);
    struct cache_value value = {malloc(size), size, count_free};
    struct tetlod_error failure = {.status = *out};
    if (*out != TETLOD_OK)
        free(value.data);
    cache_finish(cache, entry, *out == TETLOD_OK ? &value : NULL, &failure);
    return entry;
}

static void put(struct cache *cache, const char *key, size_t size)
{
    enum tetlod_status status;
    cache_release(cache, make(cache, key, size, &status));
    CHECK_INT(status, TETLOD_OK);
}

static bool has(struct cache *cache, const char *key)
{
    bool mine;
    struct cache_entry *entry = cache_fetch(cache, key, &mine);
    struct tetlod_error failure = {.status = TETLOD_ERR_IO};
    if (mine)
        cache_finish(cache, entry, NULL, &failure);
    cache_release(cache, entry);
    return !mine;
}

static void test_least_recently_used_goes(void)
{
    struct cache *cache = cache_new(5000);
    freed = 0;
    put(cache, "a", 1000);
    put(cache, "b", 1000);
    put(cache, "c", 1000);
    CHECK(has(cache, "a")); // now b is the oldest
    put(cache, "d", 1000);
    CHECK(has(cache, "a") && has(cache, "c") && has(cache, "d"));
    CHECK(!has(cache, "b"));
    CHECK_INT(freed, 1);
    cache_free(cache);
    CHECK_INT(freed, 4);
}

static void test_held_stays(void)
{
    struct cache *cache = cache_new(5000);
    enum tetlod_status status;
    struct tetlod_error failure;
    freed = 0;
    struct cache_entry *held = make(cache, "held", 4000, &status);
    CHECK_INT(status, TETLOD_OK);
    struct cache_entry *refused = make(cache, "other", 2000, &status);
    CHECK_INT(status, TETLOD_ERR_LIMIT);
    CHECK(cache_value(refused, &failure) == NULL);
    CHECK_INT(failure.status, TETLOD_ERR_LIMIT);
    cache_release(cache, refused);
    CHECK_INT(cache_value(held, &failure)->size, 4000);
    cache_release(cache, held);
    put(cache, "other", 2000); // a failure is not remembered
    CHECK_INT(freed, 1);
    refused = make(cache, "never", 6000, &status);
    CHECK_INT(status, TETLOD_ERR_ARGUMENT);
    cache_release(cache, refused);
    cache_free(cache);
}

/* Work that needs more than it has gets more or keeps what it has, and can give all of it back. */
static void test_work_grows(void)
{
    struct cache *cache = cache_new(5000);
    bool mine;
    struct cache_entry *one = cache_fetch(cache, "one", &mine), *two = cache_fetch(cache, "two", &mine);
    struct tetlod_error failure = {.status = TETLOD_ERR_LIMIT};
    struct cache_stats before, after;
    cache_get_stats(cache, &before);
    CHECK_INT(cache_reserve(cache, one, 1000), TETLOD_OK);
    CHECK_INT(cache_reserve(cache, two, 2000), TETLOD_OK);
    CHECK_INT(cache_reserve(cache, one, 2000), TETLOD_OK);
    CHECK_INT(cache_reserve(cache, one, 3000), TETLOD_ERR_LIMIT);
    CHECK_INT(cache_reserve(cache, one, 5000), TETLOD_ERR_ARGUMENT);
    cache_get_stats(cache, &after);
    CHECK_INT(after.bytes - before.bytes, 4000);
    CHECK_INT(cache_reserve(cache, two, 0), TETLOD_OK);
    CHECK_INT(cache_reserve(cache, one, 3000), TETLOD_OK);
    cache_finish(cache, one, NULL, &failure);
    cache_finish(cache, two, NULL, &failure);
    cache_release(cache, one);
    cache_release(cache, two);
    cache_get_stats(cache, &after);
    CHECK_INT(after.bytes, 0);
    cache_free(cache);
}

/* ---- many threads, few keys ---- */

enum { THREADS = 8, ROUNDS = 2000, KEYS = 5 };

struct storm {
    struct cache *cache;
    atomic_int made, served, failed;
};

struct sleeper {
    struct waiter waiter;
    pthread_mutex_t lock;
    pthread_cond_t woken;
    bool awake;
};

static void wake(struct waiter *waiter)
{
    struct sleeper *sleeper = (struct sleeper *)(void *)waiter;
    pthread_mutex_lock(&sleeper->lock);
    sleeper->awake = true;
    pthread_cond_signal(&sleeper->woken);
    pthread_mutex_unlock(&sleeper->lock);
}

static void wait_for(struct cache *cache, struct cache_entry *entry)
{
    struct sleeper sleeper = {.waiter = {.wake = wake}};
    pthread_mutex_init(&sleeper.lock, NULL);
    pthread_cond_init(&sleeper.woken, NULL);
    if (cache_wait(cache, entry, &sleeper.waiter)) {
        pthread_mutex_lock(&sleeper.lock);
        while (!sleeper.awake)
            pthread_cond_wait(&sleeper.woken, &sleeper.lock);
        pthread_mutex_unlock(&sleeper.lock);
    }
    pthread_cond_destroy(&sleeper.woken);
    pthread_mutex_destroy(&sleeper.lock);
}

static void *run_storm(void *opaque)
{
    struct storm *storm = opaque;
    unsigned seed = 1;
    for (int round = 0; round < ROUNDS; round++) {
        bool mine;
        char key[2] = {(char)('a' + rand_r(&seed) % KEYS), 0};
        struct cache_entry *entry = cache_fetch(storm->cache, key, &mine);
        struct tetlod_error failure = {.status = TETLOD_ERR_LIMIT};
        if (mine) {
            bool room = cache_reserve(storm->cache, entry, 1000) == TETLOD_OK;
            struct cache_value value = {room ? malloc(1000) : NULL, 1000, free};
            if (room)
                memset(value.data, key[0], 1000);
            cache_finish(storm->cache, entry, room ? &value : NULL, &failure);
            atomic_fetch_add(&storm->made, room);
        } else
            wait_for(storm->cache, entry);
        const struct cache_value *value = cache_value(entry, &failure);
        if (!value)
            atomic_fetch_add(&storm->failed, 1);
        else if (((char *)value->data)[0] == key[0] && ((char *)value->data)[999] == key[0])
            atomic_fetch_add(&storm->served, 1);
        cache_release(storm->cache, entry);
    }
    return NULL;
}

static void test_storm(void)
{
    struct storm storm = {.cache = cache_new(4000)}; // fewer than the keys: entries come and go
    struct cache_stats stats;
    pthread_t threads[THREADS];
    for (int i = 0; i < THREADS; i++)
        pthread_create(&threads[i], NULL, run_storm, &storm);
    for (int i = 0; i < THREADS; i++)
        pthread_join(threads[i], NULL);
    CHECK_INT(storm.served + storm.failed, THREADS * ROUNDS);
    CHECK(storm.made >= KEYS);
    cache_get_stats(storm.cache, &stats);
    CHECK(stats.bytes <= 4000);
    CHECK_INT(stats.hits + stats.misses, THREADS * ROUNDS);
    cache_free(storm.cache);
}

int main(void)
{
    RUN(test_least_recently_used_goes);
    RUN(test_held_stays);
    RUN(test_work_grows);
    RUN(test_storm);
    return test_end();
}
