/* SPDX-License-Identifier: BSD-3-Clause */
/* Which vertex of a mesh is which of another one that is the same but for the order of vertices and tetrahedra
 * (same.h). */
#ifndef TETLOD_MATCH_H
#define TETLOD_MATCH_H

#include "src/mesh/tetmesh.h"

/* out[v]: the vertex of `a` that vertex v of `b` is, by position, by the values of b's fields and of its fields of
 * cells, and by what is around it. *found is false if that takes too long to tell: where many parts of the mesh are
 * alike in all of these. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status mesh_match(const struct tetmesh *a, const struct tetmesh *b, uint32_t *out,
                                             bool *found,
                                             struct tetlod_error *error);

#endif
