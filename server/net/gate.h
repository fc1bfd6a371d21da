/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Who may connect and how long they may take to ask. libmicrohttpd divides its limit among its threads and knows only
 * idle time, which a client resets with a byte now and then; so connections are counted here, and one that has not
 * completed a request or taken an answer in time is shut down.
 */
#ifndef TETLOD_SERVER_GATE_H
#define TETLOD_SERVER_GATE_H

#include <stdbool.h>
#include <sys/socket.h>

#include "format/tetlod.h"
#include "server/net/proxies.h"

struct gate;
struct peer;
struct waiter;

/* What kind of address a connection came to. */
enum reach { REACH_NETWORK, REACH_LOOPBACK, REACH_UNIX };

struct gate_options {
    size_t connections, per_address; /* 0: no limit of its own per address */
    double request_seconds;          /* for a request to arrive, counted from the connection or the last answer */
    double answer_seconds;           /* for an answer to be taken, beside the time that its bytes have */
    size_t descriptors;              /* more than any descriptor's number */
    const struct proxies *proxies;   /* borrowed; what they connect for is not counted per address. NULL: none */
};

struct gate *gate_new(const struct gate_options *options);
void gate_free(struct gate *gate);

/* Counts a connection in; false if a limit is reached. Unix sockets have no address and count only in the total. */
bool gate_enter(struct gate *gate, int fd, const struct sockaddr *address, enum reach reach, double now);

/* The connection of a descriptor, or NULL. */
struct peer *gate_peer(struct gate *gate, int fd);

/* To be called before the descriptor is closed. */
void gate_leave(struct gate *gate, struct peer *peer);

/* A request has arrived; its answer of so many bytes is being sent; it is sent and the next one may come. Answers have
 * a deadline, for what they hold (room in the cache, a decoded stream) others wait for. */
void peer_busy(struct peer *peer);
void peer_sending(struct peer *peer, uint64_t bytes, double now);
void peer_idle(struct peer *peer, double now);

/* What waits on a connection: `leave` is called when its client has gone, and returns the waiter to be woken for it, or
 * NULL if it is being woken anyway. */
struct waiting {
    struct waiter *(*leave)(struct waiting *waiting);
};

/* From now until it is given NULL, the connection is looked at by gate_part. */
void peer_wait(struct peer *peer, struct waiting *waiting);

/* Wakes what waits on connections whose clients have gone. (A client that has closed its sending side only is taken for
 * one of them: TCP does not tell.) Returns how many. */
size_t gate_part(struct gate *gate);

/* The address as text ("unix" for Unix sockets); valid as long as the connection. */
const char *peer_address(const struct peer *peer);

/* What is counted of the address, and whether it is a trusted proxy's. */
const char *peer_network(const struct peer *peer);
bool peer_is_proxy(const struct peer *peer);

enum reach peer_reach(const struct peer *peer);

/* Shuts down connections whose request is late or whose answer is not taken, or with `idle` all that are between
 * requests. Returns how many. */
size_t gate_reap(struct gate *gate, double now, bool idle);

size_t gate_count(struct gate *gate);

#endif
