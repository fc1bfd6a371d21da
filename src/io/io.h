/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Mesh files. Formats are told by content first, by extension second. A reader turns bytes into a tetmesh: cells that
 * are not tetrahedra are split so that neighbours match, points that nothing uses are dropped and counted, integer
 * arrays become float64. A writer turns a tetmesh into bytes for a sink.
 */
#ifndef TETLOD_IO_H
#define TETLOD_IO_H

#include "format/writer.h"
#include "src/mesh/nan_fill.h"
#include "src/mesh/tetmesh.h"

struct io_read_options {
    const char *solution; /* PLOT3D solution file that belongs to a grid, or NULL */
    const struct nan_fill *nan_fill; /* what NaN values of fields become; NULL: they are refused */
};

/* What a reader did that its user should know. */
struct io_report {
    const char *format;    /* short name, static: "vtu", "vtk", "plot3d", ... */
    uint64_t split_cells;  /* cells that were not tetrahedra and were split */
    uint64_t skipped_cells; /* cells of lower dimension, which have no volume */
    uint64_t nan_filled;   /* values that were NaN and were filled */
    uint32_t skipped_arrays; /* arrays that cannot be carried: cell data, strings */
};

/* Reads and validates (tetmesh_validate) a mesh file. `report` may be NULL. Every message starts with the path. ERR_IO for what the system refuses (missing,
 * unreadable, a directory), ERR_MESH for contents. On failure *out is empty. */
TETLOD_CHECKED enum tetlod_status io_read(struct tetmesh *out, const char *path, const struct io_read_options *options,
                                          struct io_report *report, struct tetlod_error *error);

/* Whether io_write knows the path's extension: to be asked before work is spent on what it is to write. */
TETLOD_CHECKED enum tetlod_status io_check_output(const char *path, struct tetlod_error *error);

/* Writes by the path's extension, atomically: on failure no file is left and an older one stays. */
TETLOD_CHECKED enum tetlod_status io_write(const struct tetmesh *mesh, const char *path, struct tetlod_error *error);

/* The writers behind it, for the server: the whole file into a sink. */
TETLOD_CHECKED enum tetlod_status io_write_vtu(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);
/* The same without compression: many times faster, for what is compressed on its way or soon read. */
TETLOD_CHECKED enum tetlod_status io_write_vtu_plain(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                                     struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_write_vtk(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);

#endif
