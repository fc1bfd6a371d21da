/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A stream in memory, in the form from which any level is filtered and mapped without replay (no locks: it never changes).
 *
 * Vertices are slots in order of arrival. When slot v splits, one child keeps the slot and the other gets a new one whose
 * parent is v: so parent[v] < v, level k has the slots 0 .. n_k - 1, and the tetrahedra of level k are the first t_k in
 * order of arrival. A corner of the finest level stands at level k for its nearest ancestor below n_k. What a slot holds
 * (position, values) changes when it splits: each slot has a list of versions, each with the level from which it is valid.
 */
#ifndef TETLOD_SERVER_FOREST_H
#define TETLOD_SERVER_FOREST_H

#include "format/tetlod.h"
#include "src/mesh/tetmesh.h"

struct forest;

/* Replays the whole stream once. Afterwards the file is not needed. */
TETLOD_CHECKED enum tetlod_status forest_build(struct forest **out, struct tetlod_file *file, struct tetlod_error *error);
void forest_free(struct forest *forest);

uint64_t forest_bytes(const struct forest *forest);

/* The mesh of a level, vertices and tetrahedra in the cursor's order; `out` is the caller's to tetmesh_fini. O(level), and
 * one pass over the slots' parents. */
TETLOD_CHECKED enum tetlod_status forest_mesh(const struct forest *forest, uint32_t level, struct tetmesh *out,
                                              struct tetlod_error *error);

#endif
