/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The true error at samples of the original as a limit: the points of sample_points.h (every original vertex, and some
 * inside every tetrahedron that is not degenerate). It promises nothing between them. Each tetrahedron lists the
 * samples in it; a contraction sorts those of the old star into the new one. At a sample the new value is w s' + K, w
 * being the weight of the new vertex and K what the link's vertices give: its error is at most e where s' is in an
 * interval, and the best s' is found by least squares within all.
 */
#ifndef TETLOD_MEASURED_H
#define TETLOD_MEASURED_H

#include "src/simplify/limit.h"

/* Of a working mesh before its first contraction, for so many threads; borrowed. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status measured_new(struct limit *limit, const struct tetmesh *mesh,
                                               const struct working *working,
                                               unsigned threads, struct tetlod_error *error);

/* Bytes that it takes, about. */
uint64_t measured_bytes(const struct tetmesh *mesh, uint32_t components);

#endif
