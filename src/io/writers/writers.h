/* SPDX-License-Identifier: BSD-3-Clause */
/* The writers: each turns a mesh into the bytes of a file, for a sink. */
#ifndef TETLOD_IO_WRITERS_H
#define TETLOD_IO_WRITERS_H

#include "format/common/sink.h"
#include "src/mesh/tetmesh.h"

/* A unit in the XML of an array of VTK's: the text between. */
#define VTK_XML_UNIT "<InformationKey name=\"UNITS_LABEL\" location=\"vtkDataArray\">"
#define VTK_XML_UNIT_END "</InformationKey>"

typedef enum tetlod_status io_writer(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                     struct tetlod_error *error);

TETLOD_CHECKED enum tetlod_status io_write_vtu(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);
/* The same without compression: many times faster, for what is compressed on its way or soon read. */
TETLOD_CHECKED enum tetlod_status io_write_vtu_plain(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                                     struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_write_vtk(const struct tetmesh *mesh, const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);

/* The other formats. */
io_writer gmsh_write, stl_write, ply_write, medit_write, meshb_write, sol_write, xdmf_write, vtkhdf_write, exodus_write,
    vtp_write, glb_write, usda_write;

/* Of a surface that was cut out of the mesh, with the mesh's fields of points: binary STL, which has no fields, VTP and
 * binary glTF 2.0. */
struct cut;
TETLOD_CHECKED enum tetlod_status io_write_stl(const struct tetmesh *mesh, const struct cut *surface,
                                               const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_write_vtp(const struct tetmesh *mesh, const struct cut *surface,
                                               const struct tetlodi_sink *sink,
                                               struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_write_glb(const struct tetmesh *mesh, const struct cut *surface,
                                               const struct tetlodi_sink *sink,
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

/* Of a mesh with the counts, types and names of `shape`, whose arrays may be NULL but for those of cell fields, which
 * the layout borrows. The bytes are those of io_write_vtu_plain and io_write_vtk. */
TETLOD_CHECKED enum tetlod_status io_layout_vtu(struct io_layout **out, const struct tetmesh *shape,
                                                struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status io_layout_vtk(struct io_layout **out, const struct tetmesh *shape,
                                                struct tetlod_error *error);
void io_layout_free(struct io_layout *layout);

uint64_t io_layout_size(const struct io_layout *layout);

/* Writes the bytes begin .. begin + size, which the file has. */
void io_layout_read(struct io_layout *layout, const struct io_rows *rows, uint64_t begin, size_t size,
                    unsigned char *out);

#endif
