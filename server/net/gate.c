/* SPDX-License-Identifier: BSD-3-Clause */
#define _GNU_SOURCE
#include "server/net/gate.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/http/message.h"
#include "src/util/array.h"

enum { BUCKETS = 4096, SLOWEST = 16 << 10 /* bytes a second that a reader must take */ };

#define NEVER INT64_MAX

struct peer {
    struct gate *gate;
    int fd;
    bool shut, proxy;
    size_t bucket;
    enum reach reach;
    char address[INET6_ADDRSTRLEN];
    char network[INET6_ADDRSTRLEN]; // what is counted
    atomic_llong deadline; // milliseconds
    atomic_bool asking;    // between answers
    struct waiting *waiting;    // under the lock
    struct peer *older, *newer; // all connections
    struct peer *chain;         // of the address's bucket
};

struct gate {
    pthread_mutex_t lock;
    struct gate_options options;
    size_t count;
    struct peer *newest;
    struct peer **by_descriptor;
    struct peer *buckets[BUCKETS];
};

struct gate *gate_new(const struct gate_options *options)
{
    struct gate *gate = array_zero(1, sizeof *gate);
    if (!gate)
        return NULL;
    gate->by_descriptor = array_zero(options->descriptors, sizeof *gate->by_descriptor);
    if (!gate->by_descriptor) {
        free(gate);
        return NULL;
    }
    gate->options = *options;
    pthread_mutex_init(&gate->lock, NULL);
    return gate;
}

void gate_free(struct gate *gate)
{
    if (!gate)
        return;
    while (gate->newest)
        gate_leave(gate, gate->newest);
    pthread_mutex_destroy(&gate->lock);
    free(gate->by_descriptor);
    free(gate);
}

static void print_address(const struct sockaddr *address, char *out, size_t size)
{
    const void *bytes = NULL;
    snprintf(out, size, "unix");
    if (address && address->sa_family == AF_INET)
        bytes = &((const struct sockaddr_in *)(const void *)address)->sin_addr;
    else if (address && address->sa_family == AF_INET6)
        bytes = &((const struct sockaddr_in6 *)(const void *)address)->sin6_addr;
    if (bytes)
        inet_ntop(address->sa_family, bytes, out, (socklen_t)size);
}

static long long after(double now, double seconds)
{
    return (long long)((now + seconds) * 1e3);
}

static size_t bucket_of(const char *network)
{
    uint32_t hash = 2166136261u;
    for (; *network; network++)
        hash = (hash ^ (unsigned char)*network) * 16777619u;
    return (hash ^ hash >> 16) % BUCKETS;
}

static bool admits(const struct gate *gate, const struct peer *peer)
{
    size_t same = 0;
    if (gate->count >= gate->options.connections)
        return false;
    if (!gate->options.per_address || peer->reach == REACH_UNIX || peer->proxy)
        return true;
    for (const struct peer *other = gate->buckets[peer->bucket]; other; other = other->chain)
        same += strcmp(other->network, peer->network) == 0;
    return same < gate->options.per_address;
}

bool gate_enter(struct gate *gate, int fd, const struct sockaddr *address, enum reach reach, double now)
{
    struct peer *peer = (size_t)fd < gate->options.descriptors ? array_zero(1, sizeof *peer) : NULL;
    if (!peer)
        return false;
    peer->fd = fd;
    print_address(address, peer->address, sizeof peer->address);
    network_of(peer->address, peer->network);
    peer->proxy = gate->options.proxies && proxies_trust(gate->options.proxies, peer->address);
    peer->bucket = bucket_of(peer->network);
    peer->reach = reach;
    atomic_init(&peer->asking, true);
    atomic_init(&peer->deadline, after(now, gate->options.request_seconds));
    peer->gate = gate;
    pthread_mutex_lock(&gate->lock);
    bool admitted = admits(gate, peer);
    if (admitted) {
        peer->older = gate->newest;
        if (gate->newest)
            gate->newest->newer = peer;
        gate->newest = peer;
        peer->chain = gate->buckets[peer->bucket];
        gate->buckets[peer->bucket] = peer;
        gate->by_descriptor[fd] = peer;
        gate->count++;
    }
    pthread_mutex_unlock(&gate->lock);
    if (!admitted)
        free(peer);
    return admitted;
}

struct peer *gate_peer(struct gate *gate, int fd)
{
    pthread_mutex_lock(&gate->lock);
    struct peer *peer = fd >= 0 && (size_t)fd < gate->options.descriptors ? gate->by_descriptor[fd] : NULL;
    pthread_mutex_unlock(&gate->lock);
    return peer;
}

void gate_leave(struct gate *gate, struct peer *peer)
{
    pthread_mutex_lock(&gate->lock);
    struct peer **link = &gate->buckets[peer->bucket];
    while (*link != peer)
        link = &(*link)->chain;
    *link = peer->chain;
    *(peer->newer ? &peer->newer->older : &gate->newest) = peer->older;
    if (peer->older)
        peer->older->newer = peer->newer;
    gate->by_descriptor[peer->fd] = NULL;
    gate->count--;
    pthread_mutex_unlock(&gate->lock);
    free(peer);
}

void peer_busy(struct peer *peer)
{
    atomic_store_explicit(&peer->deadline, NEVER, memory_order_relaxed);
    atomic_store_explicit(&peer->asking, false, memory_order_relaxed);
}

void peer_sending(struct peer *peer, uint64_t bytes, double now)
{
    double seconds = peer->gate->options.answer_seconds + (double)bytes / SLOWEST;
    atomic_store_explicit(&peer->deadline, after(now, seconds), memory_order_relaxed);
}

void peer_idle(struct peer *peer, double now)
{
    atomic_store_explicit(&peer->deadline, after(now, peer->gate->options.request_seconds), memory_order_relaxed);
    atomic_store_explicit(&peer->asking, true, memory_order_relaxed);
}

void peer_wait(struct peer *peer, struct waiting *waiting)
{
    pthread_mutex_lock(&peer->gate->lock);
    peer->waiting = waiting;
    pthread_mutex_unlock(&peer->gate->lock);
}

/* Without data to send, the end of what the client sends is all that is seen of its going. */
static bool has_left(const struct peer *peer)
{
    struct pollfd polled = {peer->fd, peer->reach == REACH_UNIX ? 0 : POLLRDHUP, 0};
    return poll(&polled, 1, 0) == 1 && polled.revents;
}

size_t gate_part(struct gate *gate)
{
    struct waiter *left = NULL;
    size_t count = 0;
    pthread_mutex_lock(&gate->lock);
    for (struct peer *peer = gate->newest; peer; peer = peer->older) {
        struct waiter *waiter = peer->waiting && has_left(peer) ? peer->waiting->leave(peer->waiting) : NULL;
        if (!waiter)
            continue;
        waiter->next = left;
        left = waiter;
        count++;
    }
    pthread_mutex_unlock(&gate->lock);
    wake_all(left); // they cannot end before they are woken
    return count;
}

const char *peer_address(const struct peer *peer)
{
    return peer->address;
}

const char *peer_network(const struct peer *peer)
{
    return peer->network;
}

bool peer_is_proxy(const struct peer *peer)
{
    return peer->proxy;
}

enum reach peer_reach(const struct peer *peer)
{
    return peer->reach;
}

size_t gate_reap(struct gate *gate, double now, bool idle)
{
    size_t reaped = 0;
    pthread_mutex_lock(&gate->lock); // so that no descriptor is closed and used again meanwhile
    for (struct peer *peer = gate->newest; peer; peer = peer->older) {
        bool late = now * 1e3 > (double)atomic_load_explicit(&peer->deadline, memory_order_relaxed);
        if (peer->shut || !(late || (idle && atomic_load_explicit(&peer->asking, memory_order_relaxed))))
            continue;
        shutdown(peer->fd, SHUT_RDWR);
        peer->shut = true;
        reaped++;
    }
    pthread_mutex_unlock(&gate->lock);
    return reaped;
}

size_t gate_count(struct gate *gate)
{
    pthread_mutex_lock(&gate->lock);
    size_t count = gate->count;
    pthread_mutex_unlock(&gate->lock);
    return count;
}
