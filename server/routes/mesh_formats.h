/* SPDX-License-Identifier: BSD-3-Clause */
/* Formats of mesh files. */
#ifndef TETLOD_SERVER_MESH_FORMATS_H
#define TETLOD_SERVER_MESH_FORMATS_H

#include "server/http/exchange.h"
#include "src/mesh/tetmesh.h"
#include "src/util/buffer.h"

struct io_layout;

/* A file format of an answer. `write` is NULL for the stream's own prefix. */
struct mesh_format {
    const char *name, *media_type;
    enum tetlod_status (*write)(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                struct tetlod_error *error);
    enum tetlod_status (*lay_out)(struct io_layout **out, const struct tetmesh *shape, struct tetlod_error *error);
};

/* The format of a name. The stream's own prefix is one, unless it has to be written `from_mesh`. NULL: answered, with
 * the list of names. */
const struct mesh_format *take_mesh_format(struct exchange *exchange, const char *name, bool from_mesh);

TETLOD_CHECKED enum tetlod_status mesh_format_write(const struct mesh_format *format, const struct tetmesh *mesh,
                                                    struct buffer *out, struct tetlod_error *error);

/* The bytes that mesh_format_write writes. */
TETLOD_CHECKED enum tetlod_status mesh_format_measure(const struct mesh_format *format, const struct tetmesh *mesh,
                                                      uint64_t *out, struct tetlod_error *error);

/* Of a level's file, at most. */
uint64_t mesh_format_bytes_of(const struct tetlod_info *info, uint64_t vertices, uint64_t tets);
uint64_t mesh_format_bytes(const struct tetlod_info *info, uint32_t level);

#endif
