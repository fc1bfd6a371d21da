/* SPDX-License-Identifier: BSD-3-Clause */
/* A stream in a VTKHDF file (SPEC 3.10): programs that know VTKHDF see a mesh, ours the stream. */
#ifndef TETLOD_VTKHDF_STREAM_H
#define TETLOD_VTKHDF_STREAM_H

#include "format/common/sink.h"
#include "src/mesh/tetmesh.h"

/* The mesh that others see: one, or of a series one for each step, with its time in its origin. */
struct shown_meshes {
    uint32_t steps; /* 0: it is no series */
    enum tetlod_status (*mesh)(void *opaque, uint32_t step, struct tetmesh *out, struct tetlod_error *error);
    void *opaque;
};

/* The stream: `write` sends its `size` bytes to a sink. */
struct shown_stream {
    uint64_t size;
    enum tetlod_status (*write)(void *opaque, const struct tetlodi_sink *sink, struct tetlod_error *error);
    void *opaque;
};

/* ERR_NOMEM, ERR_IO, or what `write` and `mesh` say. */
TETLOD_CHECKED enum tetlod_status vtkhdf_write_stream(const struct shown_stream *stream,
                                                      const struct shown_meshes *meshes,
                                                      const struct tetlodi_sink *sink, struct tetlod_error *error);

#endif
