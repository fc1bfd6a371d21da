/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Contracting edges in parallel rounds, within a certified error that rises along a ladder (ladder.h).
 *
 * On a rung every vertex whose waiting error the limit has reached is evaluated. Then, round after round: every
 * proposal claims both its ends, by the least priority; a proposal wins if none of the vertices around its ends is
 * claimed by a lesser one; the winners, whose stars do not overlap, are contracted in parallel, and what they made is
 * evaluated. Nothing depends on how many threads there are: the claims are minima, and lists are made in the order of
 * the slots.
 */
#ifndef TETLOD_ROUNDS_H
#define TETLOD_ROUNDS_H

#include "src/simplify/simplify_options.h"
#include "src/simplify/piece.h"

/* Contracts the mesh by its envelope, edges only. As simplify(). */
TETLOD_CHECKED enum tetlod_status rounds_simplify(struct contraction_log *out, const struct tetmesh *mesh,
                                                  const uint32_t *controlled, uint32_t controlled_count,
                                                  const double *limits, const struct simplify_options *options,
                                                  struct tetlod_error *error);

/* The same of a piece, from a first limit to options->max_error. The piece is then what is left of it; its nodes are
 * those of the log, whose vertices are those that the piece had. Of the options `regions` and `boundary_least` do not
 * count: they are in the piece's state. After an error the piece is as before. */
TETLOD_CHECKED enum tetlod_status rounds_contract(struct contraction_log *out, struct piece *piece, double from,
                                                  const struct simplify_options *options, struct tetlod_error *error);

/* Bytes that this takes at its peak, about, without the mesh. */
uint64_t rounds_bytes(const struct tetmesh *mesh, uint32_t controlled_count, const struct simplify_options *options);

#endif
