/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Evaluating a vertex: of all contractions of its edges that the limit allows, the one with the best key is its
 * proposal. The result is at the other end, or at the middle (which the end of the lesser slot proposes). What is not
 * ordered by the envelope, or not of edges alone, is evaluated simplex by simplex (simplices.h), with the same kind of
 * proposals.
 *
 * A vertex without a proposal waits: `waits` is the least error that one of its possible contractions would need, so it
 * is looked at again when the limit reaches that; `waits_changed` counts those as well that only a change of its star
 * can make possible.
 *
 * Evaluating changes the worker's scratch and what is stored of that vertex; nothing that others read.
 */
#ifndef TETLOD_EVALUATE_H
#define TETLOD_EVALUATE_H

#include "src/simplify/rounds/run.h"

/* So many that propose nothing and have not been evaluated; NULL: no memory. The caller frees them. */
struct proposal *proposals_new(size_t count);

/* Bytes that the working mesh, its log, its border and its proposals take, about. */
uint64_t evaluate_bytes(const struct tetmesh *mesh, uint32_t controlled_count);

/* Scratch whose size the mesh tells; the rest grows. False: no memory. */
bool worker_init(struct worker *worker, const struct working *working);

/* Frees all that the worker has. */
void worker_fini(struct worker *worker);

void evaluate(const struct run *run, struct worker *worker, uint32_t slot);

/* The position halfway from a slot to another, as the mesh can hold it. */
void middle_of(const struct working *working, uint32_t from, uint32_t to, double p[3]);

#endif
