/* SPDX-License-Identifier: BSD-3-Clause */
/* What the operator's options say about who may read and where the site lies, checked. */
#ifndef TETLOD_SERVER_RULES_H
#define TETLOD_SERVER_RULES_H

#include "server/http/policy.h"
#include "server/options.h"

/* Reads the token's file and puts CORS, hosts and token in place. On failure nothing changes. */
TETLOD_CHECKED enum tetlod_status rules_set(struct access *access, const struct server_options *options,
                                            struct tetlod_error *error);

/* The origins of streams as text of the page's policy, allocated; NULL where there are none. */
TETLOD_CHECKED enum tetlod_status rules_stream_origins(const struct server_options *options, char **out,
                                                       struct tetlod_error *error);

/* A copy of the base path, NULL where there is none. */
TETLOD_CHECKED enum tetlod_status rules_base_path(const struct server_options *options, char **out,
                                                  struct tetlod_error *error);

#endif
