/* SPDX-License-Identifier: BSD-3-Clause */
/* Surfaces as files: VTP (raw appended), binary STL, binary glTF 2.0. VTP and glTF carry the mesh's fields. */
#ifndef TETLOD_SERVER_SURFACE_FILES_H
#define TETLOD_SERVER_SURFACE_FILES_H

#include "server/answer/buffer.h"
#include "src/cut/cut.h"

struct surface_format {
    const char *name, *media_type;
    enum tetlod_status (*write)(const struct tetmesh *mesh, const struct cut *surface, struct buffer *out);
};

extern const struct surface_format surface_formats[]; /* ends with a NULL name */

#endif
