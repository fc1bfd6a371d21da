/* SPDX-License-Identifier: BSD-3-Clause */
/* The exact limit: the largest difference of the level from the original, anywhere, is asked for (PROOF.md, 8). */
#ifndef TETLOD_EXACT_H
#define TETLOD_EXACT_H

#include "src/simplify/limit.h"

/* Of the mesh's working mesh before its first contraction, for so many threads. `mesh` and `working` are borrowed.
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status exact_new(struct limit *limit, const struct tetmesh *mesh,
                                            const struct working *working,
                                            unsigned threads, struct tetlod_error *error);

/* Bytes that it takes, about. */
uint64_t exact_bytes(uint32_t vertices, uint32_t tets, unsigned threads);

#endif
