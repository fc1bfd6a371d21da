/* SPDX-License-Identifier: BSD-3-Clause */
/* The exact maximum of a mesh's levels, from fine to coarse, by what changed: overlay.h for the moments of a
 * coarsening. */
#ifndef TETLOD_OVERLAY_LEVELS_H
#define TETLOD_OVERLAY_LEVELS_H

#include "src/log/coarsening.h"
#include "src/mesh/tetmesh.h"

struct overlay_levels;

/* Prepares to compare levels with `original` (borrowed): at first `coarsening` holds its vertices and tetrahedra, with
 * positions and values that may be rounded. Each body is compared with itself. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status overlay_levels_new(struct overlay_levels **out, const struct tetmesh *original,
                                                     struct coarsening *coarsening, unsigned threads,
                                                     struct tetlod_error *error);
void overlay_levels_free(struct overlay_levels *levels);

uint64_t overlay_levels_bytes(const struct tetmesh *original);

/* Raises io_most[field], in the field's units, to the largest difference at the level that the coarsening is at, as far
 * as that is above it; INFINITY: the field is not asked about. Once at the finest level, then once after each step.
 * What a level has in common with the one before is known to be within what io_most was then: it must not fall.
 * `reach`: only what is within it of the level's boundary is looked at, what is further inside being proved; the
 * boundaries are no further than that from each other. INFINITY: all, 0: none. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status overlay_levels_next(struct overlay_levels *levels,
                                                      const struct coarsening *coarsening,
                                                      double reach, double *io_most, struct tetlod_error *error);

#endif
