/* SPDX-License-Identifier: BSD-3-Clause */
/* Meshes whose files list them in no order of space, as some generators do: what is near in space is far in memory, and
 * every step of a build waits for it. */
#ifndef TETLOD_SPACE_ORDER_H
#define TETLOD_SPACE_ORDER_H

#include "src/mesh/tetmesh.h"

/* If the mesh is large, and most of its tetrahedra are far in memory from the one before or from corners of their
 * own: numbers the points along a Hilbert curve, and the tetrahedra by their points. Two meshes of the same points,
 * at different places, and the same tetrahedra become one, but for the order of corners. Tetrahedra that were made of
 * other cells stay as they are, since what these were is told by their order. Takes the largest array once more for
 * the call. ERR_NOMEM: the mesh is to be released. */
TETLOD_CHECKED enum tetlod_status space_order_settle(struct tetmesh *mesh, struct tetlod_error *error);

#endif
