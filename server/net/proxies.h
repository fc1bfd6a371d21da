/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The proxies that the operator trusts to say whom they ask for. Behind one, the client is the last address of
 * X-Forwarded-For that is no trusted proxy itself: what stands before it anybody may have written.
 */
#ifndef TETLOD_SERVER_PROXIES_H
#define TETLOD_SERVER_PROXIES_H

#include <netinet/in.h>
#include <stdbool.h>

#include "format/tetlod.h"

struct proxies;

/* Of addresses, networks (ADDRESS/BITS), and "unix" for whoever connects to a Unix socket. */
TETLOD_CHECKED enum tetlod_status proxies_new(struct proxies **out, const char *const *list, size_t count,
                                              struct tetlod_error *error);
void proxies_free(struct proxies *proxies);

/* Whether a connection's address, as text, is a trusted one. */
bool proxies_trust(const struct proxies *proxies, const char *address);

/* The client of a request that a trusted proxy passes on, by the header's value; false: it names none. */
bool proxies_client(const struct proxies *proxies, const char *forwarded, char out[static INET6_ADDRSTRLEN]);

/* What is counted of an address: of IPv6 the first 64 bits, for a network gives its members as many addresses as they
 * like. */
void network_of(const char *address, char out[static INET6_ADDRSTRLEN]);

#endif
