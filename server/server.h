/* SPDX-License-Identifier: BSD-3-Clause */
/* The HTTP server over a set of streams. Everything that it says goes through the log callback; it never prints. */
#ifndef TETLOD_SERVER_H
#define TETLOD_SERVER_H

#include "format/tetlod.h"

struct server_options {
    const char *listen;        /* ADDR:PORT; port 0 picks a free one */
    const char *const *paths;  /* streams, or directories of *.tetlod */
    size_t path_count;
    unsigned threads;          /* 0: one per core */
    void (*log)(void *opaque, const char *line); /* an access log line or a message; may be NULL */
    void *log_opaque;
};

struct server;

/* Opens the streams and starts answering. The options are copied. */
TETLOD_CHECKED enum tetlod_status server_start(struct server **out, const struct server_options *options,
                                               struct tetlod_error *error);

/* Its own address as http://ADDR:PORT/, valid as long as the server. */
const char *server_url(const struct server *server);

/* Stops accepting, lets answers in progress finish for a moment, frees all. */
void server_stop(struct server *server);

#endif
