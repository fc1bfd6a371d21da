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

#endif
