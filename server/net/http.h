/* SPDX-License-Identifier: BSD-3-Clause */
/* libmicrohttpd on one side, requests and responses on the other. Connections are given to it, spread over its
 * threads. */
#ifndef TETLOD_SERVER_HTTP_H
#define TETLOD_SERVER_HTTP_H

#include <sys/socket.h>

#include "server/http/message.h"
#include "server/net/gate.h"

struct http;

struct http_options {
    /* Answers a request; the response is released here. WAITING: it is asked again when the request's waiter was
     * woken. */
    enum outcome (*answer)(void *opaque, struct request *request, struct response *response);
    void (*finished)(void *opaque, const struct finished *finished); /* once for each answer */
    void *opaque;
    /* Called for what does not get its answer, or not all of it, through no fault of the client's. */
    void (*lost)(void *lost_of, const char *why);
    void *lost_of;
    struct gate *gate; /* borrowed */
    const struct proxies *proxies; /* borrowed */
    unsigned threads;
    size_t connections;
    size_t header_bytes;    /* of a request: its first line and headers */
    unsigned idle_seconds;  /* without a byte in either direction */
};

TETLOD_CHECKED enum tetlod_status http_start(struct http **out, const struct http_options *options,
                                             struct tetlod_error *error);

/* Takes over an accepted connection. */
void http_serve(struct http *http, int fd, const struct sockaddr *address, socklen_t address_size);

/* Ends all connections; the workers that answer must have come to their end before, so that no request is waiting for
 * it. */
void http_stop(struct http *http);

#endif
