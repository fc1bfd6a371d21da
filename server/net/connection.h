/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * One connection: it reads a request, asks for the answer, sends it, and begins anew. `connection_advance` goes on
 * until the socket or the answer makes it wait.
 */
#ifndef TETLOD_SERVER_CONNECTION_H
#define TETLOD_SERVER_CONNECTION_H

#include <stdatomic.h>

#include "server/http/message.h"
#include "server/net/gate.h"

struct http_options {
    /* Answers a request; the response is released here. WAITING: it is asked again when the request's waiter was
     * woken. */
    enum outcome (*answer)(void *opaque, struct request *request, struct response *response);
    void (*finished)(void *opaque, const struct finished *finished); /* once for each answer */
    void *opaque;
    struct gate *gate; /* borrowed */
    const struct proxies *proxies; /* borrowed */
    unsigned threads;
    size_t header_bytes;    /* of a request: its first line and headers */
};

struct connection;

/* What connections have in common. */
struct connections {
    struct http_options options;
    uint32_t id_base; /* of this process's request ids */
    atomic_uint_fast64_t next_id;
    /* Called from any thread, once for each time that a connection sleeps. */
    void (*woken)(struct connection *connection);
};

/* STEP_ON: there is more to do. STEP_BLOCKED: an event of its socket goes on. STEP_ASLEEP: `woken` is called, or was
 * called already. STEP_ENDED: it is to be freed. */
enum step { STEP_ON, STEP_BLOCKED, STEP_ASLEEP, STEP_ENDED };

/* A loop's list links them. */
struct connection_link {
    void *loop;
    struct connection *older, *newer; /* of the loop */
    struct connection *next;          /* in a queue */
    bool asleep, queued;
};

/* Takes over the descriptor, except where memory is out: NULL. */
struct connection *connection_new(struct connections *connections, int fd);

/* `date`: the time as HTTP writes it. */
enum step connection_advance(struct connection *connection, const char *date);

struct connection_link *connection_link(struct connection *connection);

/* Closes it; what it still sends or waits for is given up. */
void connection_free(struct connection *connection);

#endif
