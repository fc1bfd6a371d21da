/* SPDX-License-Identifier: BSD-3-Clause */
/* Is a mesh another one, bit for bit, apart from the order of vertices and tetrahedra and an even permutation of
 * corners? */
#ifndef TETLOD_SAME_H
#define TETLOD_SAME_H

#include "src/mesh/tetmesh.h"

/* Every field of b, at points and of cells, is compared with a's of the same name; fields that only a has are not.
 * ERR_MISMATCH says what differs, ERR_NOMEM. O(n log n). */
TETLOD_CHECKED enum tetlod_status mesh_same(const struct tetmesh *a, const struct tetmesh *b,
                                            struct tetlod_error *error);

/* Have both the same positions and corners, in the same order? */
bool mesh_same_order(const struct tetmesh *a, const struct tetmesh *b);

/* Gives b the order of a where it is the same mesh in that sense, whatever its values; else b stays as it is. It has no
 * values of cells. ERR_NOMEM. O(n log n), O(n) if the order is the same already. */
TETLOD_CHECKED enum tetlod_status mesh_take_order(const struct tetmesh *a, struct tetmesh *b,
                                                  struct tetlod_error *error);

#endif
