/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Mesh files. The content decides the format, then the extension. A reader turns bytes into blocks, from which one mesh is
 * made: blocks are merged, cells that are not tetrahedra are split so that neighbours match, points that nothing uses are
 * dropped and counted, integer arrays become float64. A writer turns a tetmesh into bytes for a sink.
 */
#ifndef TETLOD_IO_H
#define TETLOD_IO_H

#include "format/writer.h"
#include "src/mesh/nan_fill.h"
#include "src/mesh/tetmesh.h"

enum cell_data { CELL_DATA_KEEP, CELL_DATA_AVERAGE, CELL_DATA_DROP };

struct io_read_options {
    const char *solution; /* PLOT3D or Medit solution file that belongs to a grid, or NULL */
    const struct nan_fill *nan_fill; /* what NaN values of fields become; NULL: they are refused */
    const char *block;    /* the one block to read of a file that has several, by name; NULL: all */
    const char *time;     /* "last" or the number of a step from 0; NULL: the last */
    enum cell_data cell_data; /* AVERAGE: every cell field also becomes a point field */
    double weld;          /* tolerance, with `welds`: points are welded also where the file is one block */
    bool welds, subdivide, drop_degenerate;
    const char *output;   /* the file that will be written: a file that a file names may not be it; or NULL */
    bool follow;          /* files that a file names may be outside its folder */
};

/* What a reader did that its user should know. */
struct io_report {
    const char *format;    /* short name, static: "vtu", "vtk", "plot3d", ... */
    uint64_t split_cells;  /* cells that were not tetrahedra and were split */
    uint64_t linearised_cells; /* cells of higher order that were taken by their corners */
    uint64_t higher_cells; /* the same, of kinds that cannot be subdivided */
    uint64_t centres;      /* points that were added in the middle of cells */
    uint64_t skipped_cells; /* cells of lower dimension, which have no volume */
    uint64_t hidden_cells; /* ghosts and blanked cells, left out */
    uint64_t nan_filled;   /* values that were NaN and were filled */
    uint64_t nan_cells;    /* numbers of cell fields that are NaN, and stay so: Exodus has variables that not all blocks have */
    uint64_t welded_points;
    uint64_t dropped_tets; /* degenerate and duplicate tetrahedra that were dropped */
    uint64_t blocks;       /* merged, if there were several */
    bool names_blocks;     /* the file has blocks with names, one of which can be asked for */
    uint64_t flat_blocks;  /* files of polygons among them, left out */
    uint64_t steps, step;  /* of time in the file, and the one that was read, from 0; 0, 0: there is no time */
    double time;           /* of that step */
    uint32_t skipped_arrays; /* arrays that are not numbers */
    uint32_t partial_arrays; /* arrays that not all blocks have */
    char left_out[256];      /* names of both kinds, as many as fit */
    uint32_t averaged_fields; /* cell fields that became point fields */
};

/* Reads and validates (tetmesh_validate) a mesh file. `report` may be NULL. Every message starts with the path. ERR_IO for what the system refuses (missing,
 * unreadable, a directory), ERR_MESH for contents. On failure *out is empty. */
TETLOD_CHECKED enum tetlod_status io_read(struct tetmesh *out, const char *path, const struct io_read_options *options,
                                          struct io_report *report, struct tetlod_error *error);

/* For readers: counts an array that is left out, in one of the two counters, and notes its name of `length` bytes. */
void io_leave_out(struct io_report *report, uint32_t *counter, const char *name, size_t length);

/* A format, for a list of them. */
struct io_format {
    const char *name, *about; /* about: what of the format there is */
    const char *const *extensions; /* ends with NULL */
    bool reads, writes; /* in this binary */
};

/* False past the last. */
bool io_format(size_t number, struct io_format *out);

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

/* The same of a surface that was cut out of the mesh, with the mesh's fields of points: binary STL, which has no fields, VTP and binary
 * glTF 2.0. */
struct cut;
TETLOD_CHECKED enum tetlod_status io_write_stl(const struct tetmesh *mesh, const struct cut *surface, const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_write_vtp(const struct tetmesh *mesh, const struct cut *surface, const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_write_glb(const struct tetmesh *mesh, const struct cut *surface, const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);

/* ---- files written piece by piece, for what is larger than memory ---- */

/* The rows of a mesh: points and tetrahedra by number. */
struct io_rows {
    const void *opaque;
    /* Of column 0, the positions, or 1 + f, field f: all components of `count` points from `first` on. */
    void (*values)(const void *opaque, uint32_t column, uint64_t first, size_t count, double *out);
    void (*corners)(const void *opaque, uint64_t first, size_t count, uint32_t *out);
};

/* A file of known size of which any range can be written without the rest. For one thread at a time. */
struct io_layout;

/* Of a mesh with the counts, types and names of `shape`, whose arrays may be NULL but for those of cell fields, which the layout
 * borrows. The bytes are those of io_write_vtu_plain and io_write_vtk. */
TETLOD_CHECKED enum tetlod_status io_layout_vtu(struct io_layout **out, const struct tetmesh *shape, struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_layout_vtk(struct io_layout **out, const struct tetmesh *shape, struct tetlod_error *error);
void io_layout_free(struct io_layout *layout);

uint64_t io_layout_size(const struct io_layout *layout);

/* Writes the bytes begin .. begin + size, which the file has. */
void io_layout_read(struct io_layout *layout, const struct io_rows *rows, uint64_t begin, size_t size, unsigned char *out);

#endif
