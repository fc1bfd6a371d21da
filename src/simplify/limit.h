/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A limit that is asked about the winners of a round: a function of a star and of positions that it may be contracted
 * to. exact/ and measured.c have one each. Asking changes nothing but the thread's own, so a round's stars are asked
 * side by side; what a contraction changes is taken over one after the other, in the round's order.
 */
#ifndef TETLOD_LIMIT_H
#define TETLOD_LIMIT_H

#include <stdlib.h>

#include "src/simplify/mesh/border.h"
#include "src/simplify/mesh/star.h"

struct question {
    const struct working *working;
    const struct border *border;
    const struct star *star;
    const double (*positions)[3]; /* at which no tetrahedron flips and the boundary agrees; the best first */
    uint32_t count;
    double limit; /* fraction of the range */
    bool named;   /* levels are named after it: worth a search beside the positions */
};

/* What a contraction passes on, in its limit's own form. */
struct passed {
    uint32_t *numbers;
    size_t list_count, count, capacity; /* numbers of the first part; of all */
};

struct answer {
    bool allowed;
    double error;       /* of what is allowed; else a lower bound, above the limit */
    double position[3]; /* of what is allowed, and: */
    double *values, *errors; /* [component] the caller's room, in the field's units */
    struct passed passed, refused; /* what the limit takes over with a contraction, and in any case */
    uint64_t too_large; /* positions that were not looked at because the star is too large */
};

static inline void answer_fini(struct answer *answer)
{
    free(answer->passed.numbers);
    free(answer->refused.numbers);
    answer->passed = answer->refused = (struct passed){0};
}

struct limit {
    void *state;
    void (*release)(void *state);
    enum tetlod_status (*ask)(void *state, unsigned worker, const struct question *question, struct answer *answer,
                              struct tetlod_error *error);
    /* Every answer of a round in turn, also of what was refused. */
    enum tetlod_status (*take)(void *state, const struct star *star, const struct answer *answer,
                               struct tetlod_error *error);
    /* Slots and tetrahedra have other numbers now. */
    void (*renumber)(void *state, const struct renumbering *numbers);
    bool certifies; /* its errors hold over the whole domain */
};

#endif
