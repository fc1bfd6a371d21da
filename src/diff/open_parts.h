/* SPDX-License-Identifier: BSD-3-Clause */
/* What a difference of coarse levels leaves open, so that of finer levels only that is compared (PROOF.md 14). */
#ifndef TETLOD_OPEN_PARTS_H
#define TETLOD_OPEN_PARTS_H

#include "src/diff/difference.h"

/* Which tetrahedra of another level of the first mesh are to be compared for the limit of *out: `asked`, [tet] of it,
 * to be freed. At each place of the others the originals differ by no more than *out_most, which is within the limit.
 * `found`: the difference, of `mesh` and a second one. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status open_parts_find(const struct difference *found, const struct tetmesh *mesh,
                                                  const struct tetmesh *finer, struct difference_open *out,
                                                  double *out_most, struct tetlod_error *error);

/* Completes a difference of the open parts by what is known of the others, and of the whole. */
void open_parts_complete(struct difference *open, const uint8_t *asked, size_t tets, double most,
                         const struct difference *whole);

#endif
