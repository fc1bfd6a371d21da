/* SPDX-License-Identifier: BSD-3-Clause */
/* The HTTP server over a set of streams. Everything that it says goes through the log callbacks; it never prints. */
#ifndef TETLOD_SERVER_H
#define TETLOD_SERVER_H

#include <stdbool.h>

#include "server/options.h"

struct server;

/* Opens the streams and starts answering. Its threads block all signals. */
TETLOD_CHECKED enum tetlod_status server_start(struct server **out, const struct server_options *options,
                                               struct tetlod_error *error);

/* The address of listener `i` as a URL (http://ADDR:PORT/ or unix:PATH), valid as long as the server; NULL past the
 * last. */
const char *server_url(const struct server *server, size_t i);

/* Looks at the paths now rather than at the next scan. */
void server_rescan(struct server *server);

/* Takes token, CORS and hosts from these options; the others stay as they were. On failure all stay. */
TETLOD_CHECKED enum tetlod_status server_reload(struct server *server, const struct server_options *options,
                                                struct tetlod_error *error);

/* Stops accepting, lets answers in progress finish within drain_seconds, frees all. False: a second after that some
 * threads still work, and nothing that they use was freed; the process should end now. */
bool server_stop(struct server *server);

#endif
