/* SPDX-License-Identifier: BSD-3-Clause */
/* What is kept of a request when it is over: counters, and a line of the access log. */
#ifndef TETLOD_SERVER_ACCESS_LOG_H
#define TETLOD_SERVER_ACCESS_LOG_H

#include "server/http/exchange.h"

void site_finished(const struct site *site, const struct finished *finished);

#endif
