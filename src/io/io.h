/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Mesh files. The content decides the format, then the extension. A reader turns bytes into blocks, from which one mesh
 * is made: blocks are merged, cells that are not tetrahedra are split so that neighbours match, points that nothing
 * uses are dropped and counted, integer arrays become float64. A writer turns a tetmesh into bytes for a sink.
 */
#ifndef TETLOD_IO_H
#define TETLOD_IO_H

#include "src/io/services/report.h"
#include "src/io/writers/npz_write.h"
#include "src/io/writers/vtkhdf_stream.h"
#include "src/io/writers/writers.h"
#include "src/mesh/tetmesh.h"
#include "src/util/work_share.h"

/* Reads and validates (tetmesh_validate) a mesh file. `report` may be NULL. Every message starts with the path. ERR_IO
 * for what the system refuses (missing, unreadable, a directory), ERR_MESH for contents. On failure *out is empty. */
TETLOD_CHECKED enum tetlod_status io_read(struct tetmesh *out, const char *path, const struct io_read_options *options,
                                          struct io_report *report, struct tetlod_error *error);

/* Of a helper that is called for CALL_PIECES (work_share.h): reads its part of them, with the options that the one that
 * leads has. */
TETLOD_CHECKED enum tetlod_status io_read_help(const struct work_share *share, const struct io_read_options *options,
                                               struct tetlod_error *error);

/* A format, for a list of them. */
struct io_format {
    const char *name, *about; /* about: what of the format there is */
    const char *const *extensions; /* ends with NULL */
    bool reads, writes; /* in this binary */
};

/* False past the last. */
bool io_format(size_t number, struct io_format *out);

/* Does the file begin as a stream does, or as a file with a stream in it? False also where it cannot be read. */
bool io_is_stream(const char *path);

/* Whether io_write knows the path's extension: to be asked before work is spent on what it is to write. */
TETLOD_CHECKED enum tetlod_status io_check_output(const char *path, struct tetlod_error *error);

/* Whether it is of a format that is written with cells of any kind (tetmesh.h). */
TETLOD_CHECKED enum tetlod_status io_check_cells_output(const char *path, struct tetlod_error *error);

/* Writes by the path's extension, atomically: on failure no file is left and an older one stays. */
TETLOD_CHECKED enum tetlod_status io_write(const struct tetmesh *mesh, const char *path, struct tetlod_error *error);

/* vtkhdf_write_stream, or ERR_ARGUMENT where this program was built without libhdf5. */
TETLOD_CHECKED enum tetlod_status io_write_stream(const struct shown_stream *stream, const struct shown_meshes *meshes,
                                                  const struct tetlodi_sink *sink, struct tetlod_error *error);

#endif
