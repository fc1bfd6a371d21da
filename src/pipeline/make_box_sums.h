/* SPDX-License-Identifier: BSD-3-Clause */
/* Sums over the original by boxes of a k-d tree and by regions (SPEC 3.9). */
#ifndef TETLOD_MAKE_BOX_SUMS_H
#define TETLOD_MAKE_BOX_SUMS_H

#include "format/read/box_sums.h"
#include "src/mesh/tetmesh.h"

/* Of all fields; `regions` has a number for each tetrahedron, or is NULL; `beside` is what a component takes in section
 * SUMS: a field has 5 kB in both. To be freed. ERR_NOMEM. O(tetrahedra * depth). */
TETLOD_CHECKED enum tetlod_status box_sums_make(struct tetlodi_box_sums *out, const struct tetmesh *mesh,
                                                const double *regions, uint32_t beside, struct tetlod_error *error);

/* The same with the boxes of `like`. */
TETLOD_CHECKED enum tetlod_status box_sums_like(struct tetlodi_box_sums *out, const struct tetlodi_box_sums *like,
                                                const struct tetmesh *mesh, const double *regions,
                                                struct tetlod_error *error);

#endif
