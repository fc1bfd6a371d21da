/* SPDX-License-Identifier: BSD-3-Clause */
/* Which level an error, a size or a number asks for. */
#ifndef TETLOD_SERVER_CHOOSE_H
#define TETLOD_SERVER_CHOOSE_H

#include "server/http/exchange.h"

/* The redirection to the level's immutable URL. */
enum outcome handle_mesh(struct exchange *exchange);

/* The stream's bytes up to the level. */
enum outcome handle_prefix(struct exchange *exchange);

#endif
