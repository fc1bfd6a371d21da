/* SPDX-License-Identifier: BSD-3-Clause */
/* Exact sums over the original, and the volume that its boundary has swept at each level (SPEC 3.9). */
#ifndef TETLOD_MAKE_SUMMARY_H
#define TETLOD_MAKE_SUMMARY_H

#include "format/read/summary.h"
#include "src/log/contraction_log.h"
#include "src/mesh/tetmesh.h"

/* Volume, sums, and places of extremes of a mesh; room for so many swept volumes and thresholds, which are 0. To be
 * freed. ERR_NOMEM. O(tetrahedra). */
TETLOD_CHECKED enum tetlod_status summary_of_mesh(struct tetlodi_summary *out, const struct tetmesh *mesh,
                                                  uint32_t levels, uint32_t thresholds,
                                                  struct tetlod_error *error);

/* Fills in the volumes below the thresholds, of all components. ERR_NOMEM. O(tetrahedra * thresholds in each). */
TETLOD_CHECKED enum tetlod_status summary_fill_volumes(struct tetlodi_summary *out, const struct tetmesh *mesh,
                                                       struct tetlod_error *error);

/* `levels` has a level for each mark of the log, coarse to fine, and may have one more, the exact tail. `original` has
 * the values to sum; `contracted` is what the log is of: where its points are not the original's, swept volumes are
 * infinite. The result is to be freed. ERR_NOMEM, ERR_LIMIT. Costs O(tetrahedra + what the log does to the boundary).
 * */
TETLOD_CHECKED enum tetlod_status summary_make(struct tetlodi_summary *out, const struct tetmesh *original,
                                               const struct tetmesh *contracted, const struct contraction_log *log,
                                               uint32_t levels, struct tetlod_error *error);

#endif
