/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Contracts a mesh once more as a log says, to bound fields that did not drive that contraction. The conditions of the
 * proof (PROOF.md, 10) do not mention fields: the same sequence certifies every field by its own U and L. So the other
 * steps of a series in time are certified over one sequence.
 */
#ifndef TETLOD_RETRACE_H
#define TETLOD_RETRACE_H

#include "src/simplify/simplify.h"

struct retraced;

/* Where the contraction has come to. Components are counted through the fields of the mesh in turn. */
struct retrace_mark {
    uint32_t number;      /* of the log's marks */
    const double *halves; /* [component] the largest (U - L) / 2 so far: how far the middle of L and U is off at most */
    const struct retraced *state;
};

/* L and U at a living node (contraction_log.h). */
void retrace_bounds(const struct retraced *state, uint32_t node, uint32_t component, double out[2]);

/* `log` is of a mesh with the positions and tetrahedra of this one, by simplify with these options in its default
 * metric; the fields of `mesh` are those to bound. `visit` is called at each of the log's marks, fine to coarse; what
 * it returns ends the work unless it is OK. The result does not depend on threads. ERR_NOMEM; ERR_MISMATCH if the log
 * is not one of this mesh. */
TETLOD_CHECKED enum tetlod_status retrace(const struct tetmesh *mesh, const struct contraction_log *log,
                                          const struct simplify_options *options,
                                          enum tetlod_status (*visit)(void *opaque,
                                                                      const struct retrace_mark *mark), void *opaque,
                                          struct tetlod_error *error);

/* Bytes that it takes for a mesh with so many components, about. */
uint64_t retrace_bytes(const struct tetmesh *mesh, uint32_t components);

#endif
