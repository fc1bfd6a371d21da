/* SPDX-License-Identifier: BSD-3-Clause */
/* Values that are made once, however many requests ask for them, and the decoded streams that they are made from. */
#ifndef TETLOD_SERVER_OBTAIN_H
#define TETLOD_SERVER_OBTAIN_H

#include "server/http/exchange.h"
#include "src/util/room.h"

/* How a value that is not cached is made, and may be made again where its memory was not granted. `context` is freed
 * after use whether it was made or not. */
struct run;

struct job {
    enum tetlod_status (*make)(void *context, struct run *run, struct cache_value *out, struct tetlod_error *error);
    void (*free)(void *context);
    void *context;
    uint64_t bytes;  /* memory that making it takes, or that it begins with if it asks run_room for more */
    double wait_seconds; /* seconds from now until readers must have let go of enough */
    struct workers *workers; /* that makes it; NULL: the one for answers */
    uint64_t beside;   /* what `context` holds in the same cache: it does not make room */
};

#define MAX_WAIT_SECONDS 30.0

/* Whether what is being made is still asked for; else making it should end with fail_unwanted. */
bool run_wanted(struct run *run);
enum tetlod_status fail_unwanted(struct tetlod_error *error);

/* The memory that is reserved for what is being made. Work that is not granted more must end; it begins anew as soon as
 * there is as much. So no two jobs wait for each other's memory. */
struct room *run_room(struct run *run);

/* The value of a key, made where it is not there. ANSWERED with *out NULL: the response says why there is none. The
 * job's context is taken over. */
enum outcome obtain(struct exchange *exchange, struct cache *cache, const char *key, const struct job *job,
                    const struct cache_value **out);

/* The value of a key if it is there and finished, pinned; NULL otherwise. The short way for what is cached. */
const struct cache_value *obtain_cached(struct exchange *exchange, struct cache *cache, const char *key);

struct forest;

/* The stream in memory, decoded up to a level if it is not yet: an entry of site->memory that the caller releases, or
 * NULL. */
enum outcome obtain_forest(struct exchange *exchange, struct dataset *dataset, uint32_t level,
                           struct cache_entry **out);

const struct forest *forest_of(const struct cache_entry *entry);

/* Tells this forest from all others that the site has decoded. */
uint64_t forest_serial(const struct cache_entry *entry);

/* The entry of a value that the request has pinned; the pin becomes the caller's reference. */
struct cache_entry *obtain_take(struct request *request, const struct cache_value *value);

#endif
