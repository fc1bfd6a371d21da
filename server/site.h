/* SPDX-License-Identifier: BSD-3-Clause */
/* What the handlers share, and how one of them is found and run for a request. */
#ifndef TETLOD_SERVER_SITE_H
#define TETLOD_SERVER_SITE_H

#include <stdatomic.h>

#include "server/assets.h"
#include "server/buffer.h"
#include "server/catalogue.h"
#include "server/message.h"
#include "server/metrics.h"
#include "server/pool.h"

struct site {
    struct catalogue *catalogue;
    struct cache *cache; /* finished answers */
    struct pool *pool;     /* makes answers; NULL: the asking thread does */
    struct pool *decoders; /* decode streams, which takes longer; NULL: the asking thread does */
    struct metrics *metrics;
    const char *stream_origins; /* where else the page may load streams from: text of the policy, or NULL */
    bool serve_metrics; /* at /metrics; else only on an address of its own */
    atomic_bool draining;
};

enum outcome { ANSWERED, WAITING };

enum { CAPTURES = 5, CAPTURE_CAPACITY = 129 };

/* One request on its way through a handler. */
struct exchange {
    struct site *site;
    struct request *request;
    struct response *response;
    const char *query; /* after '?', or NULL */
    char captures[CAPTURES][CAPTURE_CAPACITY]; /* decoded, in the order of the route's template */
};

/* Answers a request. WAITING: the request's waiter will be woken, then the same request is to be given again (its pins
 * keep what it waited for). The response is the caller's to release. */
enum outcome site_answer(struct site *site, struct request *request, struct response *response);

/* A route: templates have {captures} that match one or more characters other than '/' and the character that follows. */
struct route {
    const char *template;
    enum outcome (*handle)(struct exchange *exchange);
};

/* The table, ended by a NULL template: the description and the metrics are checked against it. */
extern const struct route site_routes[];

/* How a value that is not cached is made. `context` is freed after use whether it was made or not. */
struct recipe {
    enum tetlod_status (*make)(void *context, struct cache_value *out, struct tetlod_error *error);
    void (*free)(void *context);
    void *context;
    uint64_t bytes;  /* memory that making it takes */
    double patience; /* seconds from now until readers must have let go of enough */
};

#define PATIENCE 5.0

/* The value of a key, made where it is not there. ANSWERED with *out NULL: the response says why there is none. The recipe's
 * context is taken over. */
enum outcome obtain(struct exchange *exchange, struct cache *cache, const char *key, const struct recipe *recipe,
                    const struct cache_value **out);

/* The value of a key if it is there and finished, pinned; NULL otherwise. The short way for what is cached. */
const struct cache_value *obtain_cached(struct exchange *exchange, struct cache *cache, const char *key);

/* The value of a cached answer. */
struct body {
    size_t size;
    double extract, make; /* milliseconds that it took: the level alone, and all */
    unsigned char *bytes;
};

/* Turns a buffer, which it empties, into a cache value that was made from `started` until now, its level until `extracted`. */
TETLOD_CHECKED enum tetlod_status body_take(struct buffer *buffer, double started, double extracted, struct cache_value *out,
                                            struct tetlod_error *error);

/* What headers say of a body. */
struct representation {
    const char *media_type; /* static */
    enum coding coding;
    const char *etag; /* without quotes and without coding */
    bool alone;       /* it is not sent in other codings */
};

/* Answers with a cached value that is pinned, and says where it came from. */
void respond_body(struct exchange *exchange, const struct cache_value *value, const struct representation *representation);

/* Prepares the answer 304 if the client has this representation already, so that it need not be made or read. */
bool respond_unchanged(struct exchange *exchange, const struct representation *representation, uint64_t size);

/* Answers with stored bytes of a stream: from the cache where they are not many, straight from the file otherwise. How long
 * others may keep them, the caller says. */
enum outcome respond_stored(struct exchange *exchange, struct dataset *dataset, uint64_t offset, uint64_t size,
                            const char *etag);

struct span {
    uint64_t offset, size;
};

/* The same of several pieces, one after the other. */
enum outcome respond_spans(struct exchange *exchange, struct dataset *dataset, const struct span *spans, size_t count,
                           const char *etag);

/* The response for a failure of the library. */
void respond_failure(struct exchange *exchange, const struct tetlod_error *error);

/* 404 with the ids that there are, for the first capture. */
void respond_no_mesh(struct exchange *exchange);

void cache_forever(struct response *response);
void cache_revalidate(struct response *response);

double monotonic_seconds(void);

enum outcome handle_asset(struct exchange *exchange, const struct embedded_file *asset);
enum outcome handle_view(struct exchange *exchange);
enum outcome handle_health(struct exchange *exchange);
enum outcome handle_ready(struct exchange *exchange);
enum outcome handle_metrics(struct exchange *exchange);
enum outcome handle_catalogue(struct exchange *exchange);
enum outcome handle_stream_info(struct exchange *exchange);
enum outcome handle_mesh(struct exchange *exchange);
enum outcome handle_prefix(struct exchange *exchange);
enum outcome handle_level_mesh(struct exchange *exchange);
enum outcome handle_surface(struct exchange *exchange);
enum outcome handle_isosurface(struct exchange *exchange);
enum outcome handle_slice(struct exchange *exchange);
enum outcome handle_records(struct exchange *exchange);
enum outcome handle_stream(struct exchange *exchange);

#endif
