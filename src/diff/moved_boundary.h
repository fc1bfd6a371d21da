/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The boundary of a level that is somewhere else than the original's. A place of the level that is further from it than
 * it has moved is a place of the original, too, and there the level's value is within its error (PROOF.md 14).
 */
#ifndef TETLOD_MOVED_BOUNDARY_H
#define TETLOD_MOVED_BOUNDARY_H

#include "src/mesh/mesh_surface.h"
#include "src/mesh/tetmesh.h"

/* Zeroed: a boundary that has kept its place, from which all places are far enough. */
struct moved_boundary {
    struct mesh_surface surface; /* positions are borrowed */
    double moved, shell;         /* shell: no less than the volume of all that is no further from it than that */
};

/* `neighbours` as adjacency_build makes them. ERR_NOMEM; to be released, also after a failure. */
TETLOD_CHECKED enum tetlod_status moved_boundary_find(struct moved_boundary *out, const struct tetmesh *mesh,
                                                      const uint32_t *neighbours, double moved,
                                                      struct tetlod_error *error);
void moved_boundary_fini(struct moved_boundary *boundary);

/* Is a box, or a point, further away than the boundary has moved? Of a box `false` may mean that this is not known. */
bool moved_boundary_leaves_box(const struct moved_boundary *boundary, const double box[6]);
bool moved_boundary_leaves(const struct moved_boundary *boundary, const double place[3]);

#endif
