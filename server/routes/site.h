/* SPDX-License-Identifier: BSD-3-Clause */
/* The page, health, metrics, the catalogue and the description of a stream. */
#ifndef TETLOD_SERVER_SITE_H
#define TETLOD_SERVER_SITE_H

#include "server/http/exchange.h"
#include "server/routes/assets.h"

enum outcome handle_asset(struct exchange *exchange, const struct embedded_file *asset);
enum outcome handle_view(struct exchange *exchange);
enum outcome handle_health(struct exchange *exchange);
enum outcome handle_ready(struct exchange *exchange);
enum outcome handle_metrics(struct exchange *exchange);
enum outcome handle_catalogue(struct exchange *exchange);
enum outcome handle_stream_info(struct exchange *exchange);

#endif
