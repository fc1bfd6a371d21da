/* SPDX-License-Identifier: BSD-3-Clause */
/* Surfaces of a level: its boundary, isosurfaces, plane sections. */
#ifndef TETLOD_SERVER_SURFACES_H
#define TETLOD_SERVER_SURFACES_H

#include "server/http/exchange.h"

enum outcome handle_surface(struct exchange *exchange);
enum outcome handle_isosurface(struct exchange *exchange);
enum outcome handle_slice(struct exchange *exchange);

/* The same of a step in a band. */

#endif
