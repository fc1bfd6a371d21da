/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Who may read. Browsers let a page of any site ask any server that its reader reaches. What keeps it from reading the
 * answer:
 * - CORS: pages of other origins may read only where --cors names them; by default any origin, on loopback none;
 * - Host: on loopback it must be a name of this machine, or a name that an attacker owns could be made to lead here
 * (rebinding);
 * - the token: without it nothing but /healthz and /readyz is answered, and wrong ones cost time (guesses.h).
 */
#ifndef TETLOD_SERVER_ACCESS_H
#define TETLOD_SERVER_ACCESS_H

#include "server/http/exchange.h"

enum admission { ACCESS_GRANTED, ACCESS_ANSWERED /* it may not be served */, ACCESS_WAITS };

/* `path` is below the base path. */
enum admission access_check(struct exchange *exchange, const char *path);

/* Adds the headers that tell browsers which other origins may read an answer. */
void access_headers(const struct access_policy *policy, const struct request *request, struct response *response);

/* Whether the answer may not be kept by caches that others share. */
static inline bool access_private(const struct access_policy *policy)
{
    return policy->token != NULL;
}

#endif
