/* SPDX-License-Identifier: BSD-3-Clause */
/* A chained hash table and a list by time of use under one lock, which is never held during work. */
#include "server/store/cache.h"

#include <assert.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"
#include "src/util/hash.h"

enum { BUCKETS = 1024, ENTRY_BYTES = 256 /* what an entry takes beside its value */ };

struct cache_entry {
    char *key;
    unsigned references; /* one of them the table's while `listed` */
    bool listed;
    atomic_bool finished; // set last, under the lock: who sees it may read value and failure without
    uint64_t bytes;       /* charged */
    struct cache_value value;
    struct tetlod_error failure;
    struct waiter *waiters;
    struct cache_entry *chain, *newer, *older;
};

struct cache {
    pthread_mutex_t lock;
    uint64_t capacity, used, hits, misses, entries;
    struct cache_entry *buckets[BUCKETS];
    struct cache_entry *newest, *oldest;
    struct cache_entry *dead; /* to be freed without the lock */
    struct waiter *room_waiters;
    bool released;            /* bytes, since the lock was taken */
};

struct cache *cache_new(uint64_t capacity)
{
    struct cache *cache = array_zero(1, sizeof *cache);
    if (!cache)
        return NULL;
    if (pthread_mutex_init(&cache->lock, NULL) != 0) {
        free(cache);
        return NULL;
    }
    cache->capacity = capacity;
    return cache;
}

static size_t bucket_of(const char *key)
{
    return hash_folded(hash_text(HASH_START, key)) % BUCKETS;
}

static void free_dead(struct cache_entry *entry)
{
    while (entry) {
        struct cache_entry *next = entry->chain;
        if (entry->value.free)
            entry->value.free(entry->value.data);
        free(entry->key);
        free(entry);
        entry = next;
    }
}

/* Lets go of the lock, frees what died meanwhile (a decoded stream takes a while), and wakes those who seek room if
 * there is more. */
static void unlock(struct cache *cache)
{
    struct cache_entry *dead = cache->dead;
    struct waiter *room_waiters = cache->released ? cache->room_waiters : NULL;
    if (room_waiters)
        cache->room_waiters = NULL;
    cache->dead = NULL;
    cache->released = false;
    pthread_mutex_unlock(&cache->lock);
    free_dead(dead);
    wake_all(room_waiters);
}

static void list_push(struct cache *cache, struct cache_entry *entry)
{
    entry->older = cache->newest;
    entry->newer = NULL;
    *(cache->newest ? &cache->newest->newer : &cache->oldest) = entry;
    cache->newest = entry;
}

static void list_remove(struct cache *cache, struct cache_entry *entry)
{
    *(entry->newer ? &entry->newer->older : &cache->newest) = entry->older;
    *(entry->older ? &entry->older->newer : &cache->oldest) = entry->newer;
}

static void drop_reference(struct cache *cache, struct cache_entry *entry)
{
    assert(entry->references);
    cache->released |= entry->references == 2 && entry->listed; // nobody holds it any more: it may go
    if (--entry->references)
        return;
    cache->used -= entry->bytes;
    cache->entries--;
    entry->chain = cache->dead;
    cache->dead = entry;
    cache->released = true;
}

static void unlist(struct cache *cache, struct cache_entry *entry)
{
    struct cache_entry **link = &cache->buckets[bucket_of(entry->key)];
    while (*link != entry)
        link = &(*link)->chain;
    *link = entry->chain;
    list_remove(cache, entry);
    entry->listed = false;
    drop_reference(cache, entry);
}

static bool fits(const struct cache *cache, uint64_t used, uint64_t bytes)
{
    return used <= cache->capacity && bytes <= cache->capacity - used;
}

/* Drops what nobody holds, the oldest first, until `bytes` more fit; nothing if they would not. */
static bool make_room(struct cache *cache, uint64_t bytes)
{
    uint64_t left = cache->used;
    struct cache_entry *end = cache->oldest, *entry = cache->oldest;
    for (; end && !fits(cache, left, bytes); end = end->newer)
        left -= end->references == 1 ? end->bytes : 0;
    if (!fits(cache, left, bytes))
        return false;
    while (entry != end) {
        struct cache_entry *next = entry->newer;
        if (entry->references == 1)
            unlist(cache, entry);
        entry = next;
    }
    return true;
}

void cache_free(struct cache *cache)
{
    if (!cache)
        return;
    while (cache->oldest) {
        assert(cache->oldest->references == 1);
        unlist(cache, cache->oldest);
    }
    free_dead(cache->dead);
    pthread_mutex_destroy(&cache->lock);
    free(cache);
}

static struct cache_entry *new_entry(struct cache *cache, const char *key)
{
    struct cache_entry *entry = array_zero(1, sizeof *entry);
    if (!entry || !(entry->key = strdup(key))) {
        free(entry);
        return NULL;
    }
    struct cache_entry **bucket = &cache->buckets[bucket_of(key)];
    entry->references = 2; // the table's and the caller's
    entry->listed = true;
    entry->bytes = ENTRY_BYTES;
    entry->chain = *bucket;
    *bucket = entry;
    list_push(cache, entry);
    cache->used += ENTRY_BYTES;
    cache->entries++;
    return entry;
}

/* The listed entry of a key, held and now the newest; called with the lock. */
static struct cache_entry *look_up(struct cache *cache, const char *key)
{
    struct cache_entry *entry = cache->buckets[bucket_of(key)];
    while (entry && strcmp(entry->key, key) != 0)
        entry = entry->chain;
    if (!entry)
        return NULL;
    cache->hits++;
    entry->references++;
    list_remove(cache, entry);
    list_push(cache, entry);
    return entry;
}

struct cache_entry *cache_find(struct cache *cache, const char *key)
{
    pthread_mutex_lock(&cache->lock);
    struct cache_entry *entry = look_up(cache, key);
    unlock(cache);
    return entry;
}

struct cache_entry *cache_fetch(struct cache *cache, const char *key, bool *out_mine)
{
    pthread_mutex_lock(&cache->lock);
    struct cache_entry *entry = look_up(cache, key);
    *out_mine = false;
    if (!entry) {
        cache->misses++;
        entry = new_entry(cache, key);
        *out_mine = entry != NULL;
    }
    unlock(cache);
    return entry;
}

void cache_hold(struct cache *cache, struct cache_entry *entry)
{
    pthread_mutex_lock(&cache->lock);
    entry->references++;
    unlock(cache);
}

void cache_release(struct cache *cache, struct cache_entry *entry)
{
    if (!entry)
        return;
    pthread_mutex_lock(&cache->lock);
    drop_reference(cache, entry);
    unlock(cache);
}

enum tetlod_status cache_reserve(struct cache *cache, struct cache_entry *entry, uint64_t bytes)
{
    enum tetlod_status status = TETLOD_OK;
    pthread_mutex_lock(&cache->lock);
    const uint64_t before = entry->bytes - ENTRY_BYTES;
    assert(!bytes || bytes >= before);
    if (bytes > cache->capacity || ENTRY_BYTES > cache->capacity - bytes)
        status = TETLOD_ERR_ARGUMENT;
    else if (bytes && !make_room(cache, bytes - before))
        status = TETLOD_ERR_LIMIT;
    else {
        entry->bytes = ENTRY_BYTES + bytes;
        cache->used = cache->used - before + bytes;
        cache->released |= bytes < before;
    }
    unlock(cache);
    return status;
}

void cache_finish(struct cache *cache, struct cache_entry *entry, const struct cache_value *value,
                  const struct tetlod_error *failure)
{
    pthread_mutex_lock(&cache->lock);
    cache->used -= entry->bytes;
    if (value)
        entry->value = *value;
    else
        entry->failure = *failure;
    entry->bytes = ENTRY_BYTES + entry->value.size;
    cache->used += entry->bytes;
    cache->released = true; // work takes more than what comes of it
    struct waiter *waiter = entry->waiters;
    entry->waiters = NULL;
    atomic_store(&entry->finished, true);
    if (!value && entry->listed)
        unlist(cache, entry); // the caller still holds it
    make_room(cache, 0);
    unlock(cache);
    wake_all(waiter);
}

void cache_seek_room(struct cache *cache, struct waiter *waiter)
{
    pthread_mutex_lock(&cache->lock);
    waiter->next = cache->room_waiters;
    cache->room_waiters = waiter;
    unlock(cache);
}

void cache_wake_room_waiters(struct cache *cache)
{
    pthread_mutex_lock(&cache->lock);
    cache->released = true;
    unlock(cache);
}

bool cache_wait(struct cache *cache, struct cache_entry *entry, struct waiter *waiter)
{
    pthread_mutex_lock(&cache->lock);
    bool coming = !atomic_load(&entry->finished);
    if (coming) {
        waiter->next = entry->waiters;
        entry->waiters = waiter;
    }
    unlock(cache);
    return coming;
}

void cache_wake_waiters(struct cache *cache)
{
    struct waiter *all = NULL;
    pthread_mutex_lock(&cache->lock);
    for (struct cache_entry *entry = cache->oldest; entry; entry = entry->newer)
        for (struct waiter *waiter = entry->waiters, *next; waiter; waiter = next) {
            next = waiter->next;
            waiter->next = all;
            all = waiter;
            entry->waiters = next;
        }
    unlock(cache);
    wake_all(all);
}

bool cache_unwait(struct cache *cache, struct cache_entry *entry, struct waiter *waiter)
{
    pthread_mutex_lock(&cache->lock);
    struct waiter **link = &entry->waiters;
    while (*link && *link != waiter)
        link = &(*link)->next;
    bool found = *link != NULL;
    if (found)
        *link = waiter->next;
    unlock(cache);
    return found;
}

/* Called with the lock. */
static bool is_wanted(const struct cache_entry *entry)
{
    return entry->references > (entry->listed ? 2U : 1U);
}

bool cache_wanted(struct cache *cache, const struct cache_entry *entry)
{
    pthread_mutex_lock(&cache->lock);
    bool wanted = is_wanted(entry);
    unlock(cache);
    return wanted;
}

bool cache_drop_unwanted(struct cache *cache, struct cache_entry *entry)
{
    pthread_mutex_lock(&cache->lock);
    bool drops = !is_wanted(entry);
    if (drops && entry->listed)
        unlist(cache, entry);
    unlock(cache);
    return drops;
}

bool cache_finished(const struct cache_entry *entry)
{
    return atomic_load(&entry->finished);
}

const struct cache_value *cache_value(const struct cache_entry *entry, struct tetlod_error *failure)
{
    if (!entry->failure.status)
        return &entry->value;
    *failure = entry->failure;
    return NULL;
}

const char *cache_key(const struct cache_entry *entry)
{
    return entry->key;
}

void cache_sweep(struct cache *cache, bool (*keep)(void *opaque, const char *key), void *opaque)
{
    pthread_mutex_lock(&cache->lock);
    for (struct cache_entry *entry = cache->oldest, *next; entry; entry = next) {
        next = entry->newer;
        if (entry->references == 1 && !keep(opaque, entry->key))
            unlist(cache, entry);
    }
    unlock(cache);
}

uint64_t cache_capacity(const struct cache *cache)
{
    return cache->capacity;
}

void cache_get_stats(struct cache *cache, struct cache_stats *out)
{
    pthread_mutex_lock(&cache->lock);
    *out = (struct cache_stats){cache->hits, cache->misses, cache->used, cache->entries};
    unlock(cache);
}
