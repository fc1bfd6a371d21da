/* SPDX-License-Identifier: BSD-3-Clause */
/* A level as a mesh file: VTU, legacy VTK, or the stream's own prefix. */
#ifndef TETLOD_SERVER_LEVEL_FILE_H
#define TETLOD_SERVER_LEVEL_FILE_H

#include "server/answer/buffer.h"
#include "server/answer/exchange.h"
#include "src/mesh/tetmesh.h"

/* A file format of an answer, or NULL. */
struct mesh_format;
const struct mesh_format *mesh_format_find(const char *name);

/* Whether it is written from a mesh: the stream's own prefix is not. */
bool mesh_format_writes(const struct mesh_format *format);
const char *mesh_format_name(const struct mesh_format *format);
const char *mesh_format_type(const struct mesh_format *format);
TETLOD_CHECKED enum tetlod_status mesh_format_write(const struct mesh_format *format, const struct tetmesh *mesh, struct buffer *out,
                                                    struct tetlod_error *error);

/* Of a level's file, at most. */
uint64_t mesh_format_bytes(const struct tetlod_info *info, uint32_t level);

/* 400 with the list of names. */
void respond_bad_format(struct exchange *exchange, const char *name);

enum outcome handle_level_mesh(struct exchange *exchange);

/* A step in a band, as a file that is written from its mesh. */
enum outcome handle_step_mesh(struct exchange *exchange);

#endif
