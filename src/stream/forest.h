/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A stream in memory, in the form from which any level is filtered and mapped without replay.
 *
 * Vertices are slots in order of arrival. When slot v splits, one child keeps the slot and the other gets a new one
 * whose parent is v: so parent[v] < v, level k has the slots 0 .. n_k - 1, and the tetrahedra of level k are the first
 * t_k in order of arrival. A corner of a finer level stands at level k for its nearest ancestor below n_k. What a slot
 * holds (position, values) changes when it splits: each slot has a chain of versions, each with the level from which it
 * is valid.
 *
 * Corners are kept of some levels, the stages, each some four times as large as the one before: a level is mapped from
 * the stage above it, in O(level), and is there as soon as that stage is decoded. What is there never changes: levels
 * are read by any number of threads while one decodes further, without locks.
 */
#ifndef TETLOD_FOREST_H
#define TETLOD_FOREST_H

#include "format/tetlod.h"
#include "src/mesh/tetmesh.h"

struct forest;

/* For the levels up to forest_last_level(level). Nothing is decoded yet. The file is borrowed. */
TETLOD_CHECKED enum tetlod_status forest_new(struct forest **out, struct tetlod_file *file, uint32_t level,
                                             struct tetlod_error *error);

/* For the levels up to exactly this one, with these fields (NULL: all); the values of the others are 0. */
TETLOD_CHECKED enum tetlod_status forest_new_of(struct forest **out, struct tetlod_file *file, uint32_t level,
                                                const uint32_t *fields, uint32_t count, struct tetlod_error *error);

/* The last level that a forest for `level` has: as many levels are served by one forest as do not double what is
 * decoded. */
uint32_t forest_last_level(const struct tetlod_info *info, uint32_t level);

/* Memory that decoding a forest for `level` takes at most, about. */
uint64_t forest_estimate(const struct tetlod_info *info, uint32_t level);
void forest_free(struct forest *forest);

/* Decodes one level more, one thread at a time. What only decoding needs is gone after the last level and
 * after a failure; then what is there stays, and the next call tries again. */
TETLOD_CHECKED enum tetlod_status forest_grow(struct forest *forest, struct tetlod_error *error);

const struct tetlod_info *forest_info(const struct forest *forest);

/* How many levels are there: a thread that has read it may ask for their meshes. */
uint32_t forest_levels(const struct forest *forest);

/* Memory that what is there takes. */
uint64_t forest_bytes(const struct forest *forest);

/* The mesh of a level that is there, vertices and tetrahedra in the cursor's order; `out` is the caller's to
 * tetmesh_fini. */
TETLOD_CHECKED enum tetlod_status forest_mesh(const struct forest *forest, uint32_t level, struct tetmesh *out,
                                              struct tetlod_error *error);

/* A level of which any rows can be had without the others, in forest_mesh's order. It borrows from the forest, and may
 * be read by any number of threads. */
struct forest_view;
TETLOD_CHECKED enum tetlod_status forest_view_new(struct forest_view **out, const struct forest *forest, uint32_t level,
                                                  struct tetlod_error *error);
void forest_view_free(struct forest_view *view);

/* Memory that it takes. */
uint64_t forest_view_bytes(const struct forest *forest, uint32_t level);

/* Rows from `first` on of column 0, the positions, or 1 + f, field f; corners of tetrahedra. `view` is a struct
 * forest_view. */
void forest_view_values(const void *view, uint32_t column, uint64_t first, size_t count, double *out);
void forest_view_corners(const void *view, uint64_t first, size_t count, uint32_t *out);

#endif
