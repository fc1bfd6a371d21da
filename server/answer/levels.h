/* SPDX-License-Identifier: BSD-3-Clause */
/* A level as a mesh file: VTU, legacy VTK, or the stream's own prefix. */
#ifndef TETLOD_SERVER_LEVELS_H
#define TETLOD_SERVER_LEVELS_H

#include "server/answer/exchange.h"

/* Whether there is a format of this name. */
bool mesh_format_known(const char *name);

/* 400 with the list of names. */
void respond_bad_format(struct exchange *exchange, const char *name);

enum outcome handle_level_mesh(struct exchange *exchange);

#endif
