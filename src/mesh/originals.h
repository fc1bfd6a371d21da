/* SPDX-License-Identifier: BSD-3-Clause */
/* The cells that tetrahedra were made of, kept beside these, and their bytes in a stream (format/SPEC.md, 10.1). */
#ifndef TETLOD_ORIGINALS_H
#define TETLOD_ORIGINALS_H

#include "src/mesh/tetmesh.h"

#define TAG_ORIGINALS "ORIG"

enum { ORIGINALS_ROW = 4 }; /* bytes of a row, by which it is packed */

/* Drops cells of which no tetrahedron is left, renumbers the parents, and keeps the points that cells have besides
 * those of tetrahedra (the middles of edges) as further ones; `mesh` still has all points. Before
 * tetmesh_drop_unused, which renumbers the rest. ERR_NOMEM, ERR_MESH. */
TETLOD_CHECKED enum tetlod_status originals_settle(struct tetmesh *mesh, struct tetlod_error *error);

/* The cells as bytes of a section. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status originals_encode(const struct tetmesh *mesh, unsigned char **out, size_t *out_size,
                                                   struct tetlod_error *error);

/* Turns the finest level in the original's order, with the stream's fields, into the original: its points, its cells
 * in place of tetrahedra, values of cells once a cell. Further points have no values at steps: `of_step` refuses
 * a mesh with such points. ERR_STREAM, ERR_ARGUMENT, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status originals_decode(struct tetmesh *mesh, const unsigned char *bytes, size_t size,
                                                   bool of_step, struct tetlod_error *error);

#endif
