/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * HTTP/1.1 on sockets that do not block: bytes on one side, requests and responses on the other. Each thread has some
 * of the connections and waits for all of them at once; it never blocks on one. A request that waits for something
 * leaves its thread, and is taken up again when its waiter is woken.
 *
 * What a client hears is never nothing: a request that is refused gets a problem, whatever is wrong with it, and its
 * connection ends when the client has had time to read that.
 */
#ifndef TETLOD_SERVER_HTTP_H
#define TETLOD_SERVER_HTTP_H

#include "server/net/connection.h"

struct http;

TETLOD_CHECKED enum tetlod_status http_start(struct http **out, const struct http_options *options,
                                             struct tetlod_error *error);

/* Takes over an accepted connection that the gate has let in, and that does not block. */
void http_serve(struct http *http, int fd);

/* Ends all connections; the workers that answer must have come to their end before, so that no request is waiting for
 * it. */
void http_stop(struct http *http);

#endif
