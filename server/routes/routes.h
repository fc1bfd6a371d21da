/* SPDX-License-Identifier: BSD-3-Clause */
/* From a request to its handler: the table of routes, methods, conditions and ranges. */
#ifndef TETLOD_SERVER_ROUTES_H
#define TETLOD_SERVER_ROUTES_H

#include "server/http/exchange.h"

/* A line of routes.def. */
struct route {
    const char *template;
    enum outcome (*handle)(struct exchange *exchange);
    const char *parameters; /* of its query, or NULL */
    bool health; /* answered at the metrics' own address, too */
    bool of_step; /* the template has a band and a step, not a level */
};

/* The table, ended by a NULL template: the description and the metrics are checked against it. */
extern const struct route site_routes[];

/* Answers a request. WAITING: the request's waiter will be woken, then the same request is to be given again (its pins
 * keep what it waited for). The response is the caller's to release. */
enum outcome site_answer(struct site *site, struct request *request, struct response *response);

#endif
