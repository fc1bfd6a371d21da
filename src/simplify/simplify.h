/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The contraction sequence of a mesh: its edges, faces and tetrahedra are contracted in parallel rounds, within an
 * error limit that rises along a ladder of rungs, so that one sequence serves every error (rounds.h).
 */
#ifndef TETLOD_SIMPLIFY_H
#define TETLOD_SIMPLIFY_H

#include "src/log/contraction_log.h"
#include "src/simplify/simplify_options.h"

/* Contracts the mesh. `controlled`: the fields whose error is limited; `limits` (may be NULL): their own limits as
 * multiples of the common one. Only the log is left of it. */
TETLOD_CHECKED enum tetlod_status simplify(struct contraction_log *out, const struct tetmesh *mesh,
                                           const uint32_t *controlled, uint32_t controlled_count, const double *limits,
                                           const struct simplify_options *options, struct tetlod_error *error);

/* Is it contracted as by default: edges, by their envelope? Then it can be cell by cell. */
bool simplify_in_rounds(const struct simplify_options *options);

/* Bytes that this takes at its peak, about, without the mesh. */
uint64_t simplify_bytes(const struct tetmesh *mesh, uint32_t controlled_count, const struct simplify_options *options);

#endif
