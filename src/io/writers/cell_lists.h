/* SPDX-License-Identifier: BSD-3-Clause */
/* Cells of any kind as the lists that VTK's formats have. */
#ifndef TETLOD_CELL_LISTS_H
#define TETLOD_CELL_LISTS_H

#include "src/mesh/tetmesh.h"

struct cell_lists {
    size_t cell_count, connectivity_count, face_count;
    uint32_t *connectivity; /* owned, as all here: points of each cell, those of a polyhedron as its faces name them */
    uint32_t *ends;         /* [cell] of its points in the connectivity */
    uint32_t *types;        /* [cell] */
    uint32_t *faces;        /* of the polyhedra: number of faces, and for each the number of its points and these */
    uint32_t *face_ends;    /* [cell] of its faces there; UINT32_MAX: it is no polyhedron */
};

/* To be freed also after a failure. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status cell_lists_make(struct cell_lists *out, const struct cells *cells,
                                                  struct tetlod_error *error);
void cell_lists_fini(struct cell_lists *lists);

#endif
