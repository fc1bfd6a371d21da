/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Evaluating a vertex simplex by simplex: each edge, face or tetrahedron belongs to its vertex of the least slot, whose
 * proposal is the best of them. What is known of a simplex that is not contracted is kept: most of them need not be
 * looked at again on the next rungs.
 */
#ifndef TETLOD_SIMPLICES_H
#define TETLOD_SIMPLICES_H

#include "src/simplify/rounds/run.h"
#include "src/simplify/rounds/outcome.h"

/* A simplex that was evaluated. */
struct known {
    uint32_t name; /* of its other vertices' nodes: those of a result are new. Of an edge it is the node */
    float bound;   /* the least error that it needs */
    /* when; false: only a change of its star can make it possible; a limit has said so */
    uint32_t round : 30, possible : 1, asked : 1;
};

struct notes {
    struct known *known;
    uint32_t count;
};

struct trials *trials_new(void); /* NULL: no memory */
void trials_free(struct trials *trials);

void evaluate_simplices(const struct run *run, struct worker *worker, uint32_t slot);

/* Where a candidate of the simplex is. False: it has none. */
bool simplex_position(const struct run *run, const struct join *join, uint32_t candidate, double p[3]);

/* Candidates of a simplex of so many vertices. */
static inline uint32_t simplex_candidates(const struct run *run, uint32_t count)
{
    return count + 1 + (run->quadrics.sums != NULL); // its vertices, their centre, the quadrics' optimum
}

/* Asks about the slot's proposal: its candidates at which nothing turns over, best first. */
TETLOD_CHECKED enum tetlod_status simplex_ask(const struct run *run, struct worker *worker, unsigned number,
                                              uint32_t slot,
                                              struct answer *answer, struct tetlod_error *error);

/* The slot's proposal was refused: it is not to be asked again below that error. */
void simplex_refused(const struct run *run, uint32_t slot, double error);

/* Has a star that the slot's simplices depend on changed since they were evaluated? */
bool simplices_changed(const struct run *run, uint32_t slot);

/* Forgets what is known of a slot's simplices. */
void notes_free(struct notes *notes);

#endif
