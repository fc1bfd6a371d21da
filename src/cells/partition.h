/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Cells: a mesh cut by a k-d tree into parts of about so many tetrahedra (format/cuts.h). Where to cut matters more
 * than anything: vertices of a seam are not contracted. So of the places near the middle the one is taken that the
 * fewest tetrahedra cross, and those count more that were at a seam before, because they have waited already.
 */
#ifndef TETLOD_PARTITION_H
#define TETLOD_PARTITION_H

#include "format/common/cuts.h"
#include "src/mesh/tetmesh.h"
#include "src/util/parallel.h"

struct partition {
    struct tetlodi_cut *tree; /* [nodes] in preorder; owned */
    uint32_t nodes, cells;
    struct tetlodi_box *boxes; /* [cell] what the tree leaves for it; owned */
    uint32_t *begins;          /* [cells + 1] in `tets`; owned */
    uint32_t *tets;            /* [tet_count] cell by cell, ascending in each; owned */
    uint8_t *seams;            /* [vertex] it has tetrahedra in several cells; owned */
};

/* Cuts the mesh, on the pool's threads. was_seam[vertex]: it was at a seam of the last partition; NULL: there was none.
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status partition_make(struct partition *out, const struct tetmesh *mesh, uint32_t cell_tets,
                                                 const uint8_t *was_seam, struct pool *pool,
                                                 struct tetlod_error *error);
void partition_fini(struct partition *partition);

#endif
