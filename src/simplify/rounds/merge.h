/* SPDX-License-Identifier: BSD-3-Clause */
/* Contracting what was proposed: the outcome with the proof's slack, then the complex, the fields and the log. */
#ifndef TETLOD_MERGE_H
#define TETLOD_MERGE_H

#include "src/simplify/rounds/run.h"

/* What a contraction of a round came to. */
struct merged {
    bool done;        /* false: refused to the letter; the vertex waits */
    uint32_t kept, vertices, removed; /* the result's slot; vertices and tetrahedra that are gone */
    double moved;     /* how far the boundary has moved there in all */
};

/* Contracts the slot's proposal and writes the log's record. Safe beside others none of whose vertices is a neighbour
 * of these. `answer`: of the limit that allowed it, or NULL. `certified` and `predicted` (per component): the errors of
 * the result as fractions of the range. */
void merge(const struct run *run, struct worker *worker, uint32_t slot, uint32_t record, const struct answer *answer,
           struct merged *out, double *certified, double *predicted);

#endif
