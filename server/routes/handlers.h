/* SPDX-License-Identifier: BSD-3-Clause */
/* The handlers that routes.def names. */
#ifndef TETLOD_SERVER_HANDLERS_H
#define TETLOD_SERVER_HANDLERS_H

#include "server/http/exchange.h"

#define ROUTE(template, handle, ...) enum outcome handle(struct exchange *exchange);
#define MADE(what, handle, ...) enum outcome handle(struct exchange *exchange);
#include "server/routes/routes.def"
#undef ROUTE
#undef MADE

#endif
