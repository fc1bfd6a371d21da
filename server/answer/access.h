/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Who may read. Browsers let a page of any site ask any server that its reader reaches. What keeps it from reading the answer:
 * - CORS: pages of other origins may read only where --cors names them; by default any origin, on loopback none;
 * - Host: on loopback it must be a name of this machine, or a name that an attacker owns could be made to lead here (rebinding);
 * - the token: without it nothing but /healthz and /readyz is answered.
 */
#ifndef TETLOD_SERVER_ACCESS_H
#define TETLOD_SERVER_ACCESS_H

#include "server/answer/exchange.h"

/* False: answered, because the request may not be served. `path` is below the base path. */
bool access_allows(struct exchange *exchange, const char *path);

/* Adds the headers that tell browsers which other origins may read an answer. */
void access_headers(const struct site *site, const struct request *request, struct response *response);

/* Whether the answer may not be kept by caches that others share. */
static inline bool access_private(const struct site *site)
{
    return site->access.token != NULL;
}

#endif
