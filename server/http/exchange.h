/* SPDX-License-Identifier: BSD-3-Clause */
/* What the handlers share: the site, and one request on its way through a handler. */
#ifndef TETLOD_SERVER_EXCHANGE_H
#define TETLOD_SERVER_EXCHANGE_H

#include <stdatomic.h>

#include "server/http/message.h"
#include "server/http/metrics.h"
#include "server/http/policy.h"
#include "server/http/quota.h"
#include "server/store/catalogue.h"
#include "server/store/workers.h"

struct site {
    struct catalogue *catalogue;
    struct cache *cache;  /* finished answers */
    struct cache *memory; /* decoded streams, and answers that are too large for the cache */
    struct workers *workers;  /* makes answers; NULL: the asking thread does */
    struct workers *readers;  /* read stored bytes, which may hang; NULL: the asking thread does */
    struct workers *decoders; /* decode streams, which takes longer; NULL: the asking thread does */
    struct metrics *metrics;
    size_t (*connections)(void *opaque); /* how many there are; NULL: none */
    void *connections_of;
    const char *stream_origins; /* where else the page may load streams from: text of the policy, or NULL */
    const char *base_path; /* "/x/": where the site begins for its clients; NULL: "/" */
    bool secure_cookie;    /* the token's cookie goes over TLS only */
    struct access *access; /* who may read; NULL: everybody */
    struct guesses *guesses; /* NULL: wrong tokens do not wait */
    bool serve_metrics; /* at /metrics; else only on an address of its own */
    bool only_health;   /* it is that address: /metrics, /healthz and /readyz, without token */
    void (*access_log)(void *opaque, const char *line); /* a JSON object for each answer; may be NULL */
    void *access_log_of;
    struct quota jobs;      /* answers that are being made */
    size_t jobs_per_client; /* 0: as many as they like */
    atomic_uint_fast64_t forests; /* decoded so far */
    atomic_bool draining;
};

/* Where an answer is kept that takes so much to make: what would fill the cache has room beside the streams. */
static inline struct cache *cache_for(const struct site *site, uint64_t bytes)
{
    return bytes > cache_capacity(site->cache) / 2 ? site->memory : site->cache;
}

enum { CAPTURES = 5, CAPTURE_CAPACITY = 129 };

struct exchange {
    struct site *site;
    struct request *request;
    struct response *response;
    const struct access_policy *policy; /* held */
    struct dataset *dataset; /* the stream that the path names, held; NULL: it names none */
    const char *path;  /* below the base path, with its '/'; up to the query */
    const char *query; /* after '?', or NULL */
    const char *parameters; /* of the query that the route knows, as check_parameters wants them; NULL: it heeds none */
    bool of_step;           /* the path has a band and a step, not a level */
    char captures[CAPTURES][CAPTURE_CAPACITY]; /* decoded, in the order of the route's template */
};

#endif
