/* SPDX-License-Identifier: BSD-3-Clause */
/* Sorting large meshes in space. Mesh generators often write points and tetrahedra in an order that has nothing to do
 * with where they are: neighbours are then far apart in memory, which makes every step of a build slow. */
#ifndef TETLOD_SPACE_ORDER_H
#define TETLOD_SPACE_ORDER_H

#include "src/mesh/tetmesh.h"

/* Sorts the points along a Hilbert curve and the tetrahedra by their points, if the mesh is large and most tetrahedra
 * are far in memory from the one before, or have corners that are far from each other. Else it stays as it is; so does
 * one with tetrahedra that were split from other cells (`parents`). Where no two points share a place, the result does
 * not depend on the order before, but for the order of a tetrahedron's corners. Needs a copy of one array at a time.
 * ERR_NOMEM: the mesh is to be released. */
TETLOD_CHECKED enum tetlod_status space_order_settle(struct tetmesh *mesh, struct tetlod_error *error);

#endif
