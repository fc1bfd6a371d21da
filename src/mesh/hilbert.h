/* SPDX-License-Identifier: BSD-3-Clause */
/* Points along a Hilbert curve: what is near in space is near in memory. */
#ifndef TETLOD_HILBERT_H
#define TETLOD_HILBERT_H

#include <stdbool.h>

#include "format/tetlod.h"

/* order[i] is the i-th point along the curve through the points' bounding cube; equal points keep their order. `order`
 * is the caller's. The same on every machine. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status hilbert_order(const double *positions, uint32_t count, uint32_t *order,
                                                struct tetlod_error *error);

#endif
