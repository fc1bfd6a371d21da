/* SPDX-License-Identifier: BSD-3-Clause */
/* A level as a mesh file: VTU, legacy VTK, or the stream's own prefix. */
#ifndef TETLOD_SERVER_LEVEL_FILE_H
#define TETLOD_SERVER_LEVEL_FILE_H

#include "server/http/buffer.h"
#include "server/http/exchange.h"
#include "src/mesh/tetmesh.h"

/* A file format of an answer. The stream's own prefix is one, unless it has to be written `from_mesh`. NULL: answered, with the list of names. */
struct mesh_format;
const struct mesh_format *take_mesh_format(struct exchange *exchange, const char *name, bool from_mesh);

const char *mesh_format_name(const struct mesh_format *format);
const char *mesh_format_type(const struct mesh_format *format);
TETLOD_CHECKED enum tetlod_status mesh_format_write(const struct mesh_format *format, const struct tetmesh *mesh, struct buffer *out,
                                                    struct tetlod_error *error);

/* The bytes that mesh_format_write writes. */
TETLOD_CHECKED enum tetlod_status mesh_format_measure(const struct mesh_format *format, const struct tetmesh *mesh,
                                                      uint64_t *out, struct tetlod_error *error);

/* Of a level's file, at most. */
uint64_t mesh_format_bytes(const struct tetlod_info *info, uint32_t level);

enum outcome handle_mesh_file(struct exchange *exchange);

/* A step in a band, as a file that is written from its mesh. */

#endif
