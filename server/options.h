/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_SERVER_OPTIONS_H
#define TETLOD_SERVER_OPTIONS_H

#include "format/tetlod.h"

/* Addresses are ADDR:PORT, [ADDR]:PORT (port 0 picks a free one), unix:PATH, or fd:N for a socket that listens already.
 * Strings are copied; 0 means the default in brackets. */
struct server_options {
    const char *const *listen;
    size_t listen_count;
    const char *metrics;         /* address for /metrics alone; NULL: served with the rest */
    const char *const *paths;    /* streams, or folders of *.tetlod and *.vtkhdf */
    size_t path_count;
    const char *const *cors;     /* origins that may read answers, or "*", or "none" ["*", on local addresses none] */
    size_t cors_count;
    const char *const *hosts;    /* names that Host may have on loopback beside localhost, or "*" */
    size_t host_count;
    const char *token_file;      /* what is in it must come with every request; NULL: nothing must */
    int secure_cookie;           /* the token's cookie goes over TLS only */
    const char *const *proxies;  /* that are trusted to say whom they ask for: ADDRESS, ADDRESS/BITS, "unix" */
    size_t proxy_count;
    const char *base_path;       /* of the site's URLs, begins and ends with '/' ["/"] */
    const char *const *stream_origins; /* origins whose streams the page may load beside those of the server itself */
    size_t stream_origin_count;
    unsigned threads;            /* [one per core] */
    uint64_t cache_bytes;        /* of answers that were made [256 MiB] */
    /* of decoded streams, and of answers too large for the cache [half of the machine's] */
    uint64_t memory_bytes;
    size_t connections;          /* at a time [4096] */
    size_t connections_per_address; /* [no limit] */
    size_t jobs_per_client;      /* answers that are being made at a time [64] */
    size_t header_bytes;         /* request line and headers of a request [8 KiB] */
    double idle_seconds;         /* for a request to arrive, and for a reader that stalls [30] */
    double drain_seconds;        /* for answers in progress when stopping [10] */
    double grace_seconds;        /* of these, in which connections are still accepted [0] */
    unsigned socket_mode;        /* of Unix sockets [0666 less the umask] */
    double scan_seconds;         /* between looks at the paths [2] */
    double keep_replaced;        /* seconds that a replaced stream stays after its last request [60] */
    void (*access)(void *opaque, const char *line); /* one JSON object for each answer; may be NULL */
    void (*log)(void *opaque, const char *level, const char *message); /* may be NULL */
    void *log_opaque;
};

#endif
