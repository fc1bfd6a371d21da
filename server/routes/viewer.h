/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETLOD_SERVER_VIEWER_H
#define TETLOD_SERVER_VIEWER_H

#include "server/http/exchange.h"
#include "server/routes/assets.h"

enum outcome handle_asset(struct exchange *exchange, const struct embedded_file *asset);

#endif
