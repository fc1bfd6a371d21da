/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Results that are worth keeping, by key, within a number of bytes. However many ask for a key at once, one of them
 * makes it: the others wait for the entry, which is complete or not there at all.
 *
 * An entry lives as long as somebody holds it; what nobody holds stays until its bytes are needed, least recently used
 * first. Bytes count from the reservation before the work to the end of the last reader, so that the sum of all that is
 * being made, kept and sent never exceeds the capacity. All functions may be called from any thread.
 */
#ifndef TETLOD_SERVER_CACHE_H
#define TETLOD_SERVER_CACHE_H

#include <stdbool.h>

#include "format/tetlod.h"
#include "server/store/waiter.h"

struct cache;
struct cache_entry;

struct cache_value {
    void *data; /* owned by the entry */
    size_t size;
    void (*free)(void *data);
};

struct cache_stats {
    uint64_t hits, misses, bytes, entries;
};

/* NULL if memory is out. Freed only when nobody holds an entry. */
struct cache *cache_new(uint64_t capacity);
void cache_free(struct cache *cache);

/* A reference to the entry of a key, made if it is not there; NULL if memory is out. *out_mine: the caller is the one
 * to finish it. */
struct cache_entry *cache_fetch(struct cache *cache, const char *key, bool *out_mine);

/* The same without making one; NULL if it is not there. */
struct cache_entry *cache_find(struct cache *cache, const char *key);

void cache_hold(struct cache *cache, struct cache_entry *entry);
void cache_release(struct cache *cache, struct cache_entry *entry);

/* Makes room for work on an entry of mine, so much in all: more than before, or nothing. ERR_LIMIT if readers hold what
 * would have to go (try later), ERR_ARGUMENT if it is more than the capacity (never); then what was reserved before
 * stays. */
TETLOD_CHECKED enum tetlod_status cache_reserve(struct cache *cache, struct cache_entry *entry, uint64_t bytes);

/* Registers a waiter for the next time that there may be more room. */
void cache_seek_room(struct cache *cache, struct waiter *waiter);

/* Wakes those who seek room, whether there is more or not: they may have waited long enough. */
void cache_wake_room_waiters(struct cache *cache);

/* Completes an entry of mine, whose reservation becomes the value's size, or with a status other than OK says why there
 * is none and forgets the key. Wakes who waits. */
void cache_finish(struct cache *cache, struct cache_entry *entry, const struct cache_value *value,
                  const struct tetlod_error *failure);

/* Registers a waiter for the end of an entry's making; false if the entry is finished already and nobody will be
 * woken. */
bool cache_wait(struct cache *cache, struct cache_entry *entry, struct waiter *waiter);

/* Wakes all who wait for entries, though these are not finished: they may have waited long enough. */
void cache_wake_waiters(struct cache *cache);

/* Takes a waiter back; false: it is being woken. */
bool cache_unwait(struct cache *cache, struct cache_entry *entry, struct waiter *waiter);

/* Whether anybody but the caller, who makes it, holds the entry. */
bool cache_wanted(struct cache *cache, const struct cache_entry *entry);

/* Forgets the key of an entry of mine if nobody else holds it: whoever asks next makes another one. False: somebody
 * does. */
bool cache_drop_unwanted(struct cache *cache, struct cache_entry *entry);

bool cache_finished(const struct cache_entry *entry);

/* Of a finished entry: its value, or NULL and why. */
const struct cache_value *cache_value(const struct cache_entry *entry, struct tetlod_error *failure);

const char *cache_key(const struct cache_entry *entry);

/* Drops what nobody holds and `keep` does not want any more. */
void cache_sweep(struct cache *cache, bool (*keep)(void *opaque, const char *key), void *opaque);

uint64_t cache_capacity(const struct cache *cache);

void cache_get_stats(struct cache *cache, struct cache_stats *out);

#endif
