/* SPDX-License-Identifier: BSD-3-Clause */
/* What the readers share: from counts, values and cells of a file to a tetmesh. */
#ifndef TETLOD_ASSEMBLE_H
#define TETLOD_ASSEMBLE_H

#include "src/io/io.h"

/* A whole file in memory, and for formats of two files the other one (else NULL). */
struct io_input {
    const unsigned char *bytes;
    size_t size;
    const unsigned char *other;
    size_t other_size;
    const char *other_path;
    const struct nan_fill *nan_fill; /* what NaN values become; NULL: they are refused */
};

/* Room for points; ERR_MESH if there are more than ids can name. The caller has checked the count against the file. */
TETLOD_CHECKED enum tetlod_status assemble_points(struct tetmesh *mesh, uint64_t count, enum tetlod_type type,
                                                  struct tetlod_error *error);

/* tetmesh_add_field with a name that any format can hold: what is not UTF-8 or is a control character becomes '_', an
 * empty one "field", one that is taken gets a number. */
TETLOD_CHECKED enum tetlod_status assemble_field(struct tetmesh *mesh, const char *name, uint64_t components,
                                                 enum tetlod_type type, struct tetlod_error *error);

/* Cells in VTK's terms: cell i is of VTK type types[i] and has the corners connectivity[offsets[i] .. offsets[i+1]). */
struct vtk_cells {
    uint64_t count, connectivity_count;
    const unsigned char *types;
    const int64_t *offsets; /* count + 1 */
    const int64_t *connectivity;
};

/* Appends the tetrahedra of the cells: first those that are tetrahedra, as they are, then those of cells that are split,
 * turned as most of the first are. Their point 0 is the mesh's point first_point, of point_count that they may use. Cells of
 * higher order are taken by their corners. */
TETLOD_CHECKED enum tetlod_status assemble_vtk_cells(struct tetmesh *mesh, const struct vtk_cells *cells,
                                                     uint32_t first_point, uint32_t point_count,
                                                     struct io_report *report, struct tetlod_error *error);

/* Cells that are read one by one. */
struct cell_list {
    struct vtk_cells cells;
    unsigned char *types; /* owned, like the next two */
    int64_t *offsets, *connectivity;
    size_t type_capacity, offset_capacity, connectivity_capacity;
};

/* VTK's types of the linear cells, and one that stands for all that have no volume. */
enum { VTK_TYPE_FLAT = 5, VTK_TYPE_TET = 10, VTK_TYPE_HEXAHEDRON = 12, VTK_TYPE_WEDGE = 13, VTK_TYPE_PYRAMID = 14 };

TETLOD_CHECKED enum tetlod_status cell_list_add(struct cell_list *list, unsigned char type, const int64_t *corners,
                                                size_t corner_count, struct tetlod_error *error);
void cell_list_fini(struct cell_list *list);

/* The tetrahedra of a structured grid whose points are the mesh's. */
TETLOD_CHECKED enum tetlod_status assemble_grid(struct tetmesh *mesh, const uint32_t dims[3], struct io_report *report,
                                                struct tetlod_error *error);

#endif
