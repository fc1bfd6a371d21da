/* SPDX-License-Identifier: BSD-3-Clause */
/* What the rounds share: proposals of the slots, scratch of the threads, and how the run orders and limits
 * contractions. */
#ifndef TETLOD_RUN_H
#define TETLOD_RUN_H

#include <string.h>

#include "src/simplify/mesh/border.h"
#include "src/simplify/mesh/kernels.h"
#include "src/simplify/ladder.h"
#include "src/simplify/limit.h"
#include "src/simplify/mesh/links.h"
#include "src/simplify/simplify_options.h"
#include "src/simplify/rounds/quadrics.h"

struct proposal {
    uint64_t priority; /* the least goes first; PROPOSES_NOTHING */
    uint32_t target;   /* 2 * the other end's slot + (the result is in the middle) */
    float waits, waits_changed;
    uint32_t evaluated; /* the round in which it was */
    uint32_t changed;   /* the round in which its star was last */
    uint8_t dirty;      /* enum dirty */
    bool collected;     /* it is in the list that is made now */
};

enum dirty { CLEAN, TOUCHED, LEFT }; /* its star has changed since it was evaluated; and it was left so in this rung */

static const uint64_t PROPOSES_NOTHING = ~(uint64_t)0;

/* A proposal by a simplex of any kind, where vertices are evaluated simplex by simplex. */
struct plan {
    uint32_t others[3]; /* its other vertices; TETLOD_NONE behind the last */
    uint8_t candidate;  /* of simplices.h: where the result is */
};

/* A permutation of 32 bits that looks random: ties of the priority. */
static inline uint32_t scramble(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ x >> 16;
}

/* The key without so many of its lowest bits, then at random, so that what is proposed at once is not all in one
 * place. */
static inline uint64_t priority_of(double key, uint32_t slot, int bits)
{
    uint64_t number;
    key += 0.0;
    memcpy(&number, &key, sizeof number);
    return (number >> bits << 32) | scramble(slot);
}

struct candidate {
    double key, error; /* error: of a middle that is not examined a lower bound */
    uint32_t neighbour;
    bool middle, passed; /* passed: it was examined */
};

/* What a thread works with. */
struct worker {
    struct star_data data;
    struct links links;
    struct boundary_map map;
    struct weighing weighing;
    struct star star;
    struct trials *trials; /* of simplices.c */
    struct star_values *star_values; /* [value_count / WIDE, rounded up] the fields' values at a position in the star */
    struct candidate *candidates;
    size_t candidate_room;
    uint32_t *list; /* tetrahedra of two stars */
    size_t list_room;
    double *numbers; /* scratch per component: see numbers_of */
    uint32_t *open; /* boundary slots whose boundary faces contractions of this round have moved */
    size_t open_count, open_room;
    uint32_t *unfreezing; /* frozen slots around contractions of this round that moved nothing */
    size_t unfreezing_count, unfreezing_room;
    uint64_t refused[LOG_REFUSALS];
    bool failed; /* out of memory */
};

struct run {
    struct working *working;
    struct border border;
    struct proposal *proposals; /* [slot] */
    struct plan *plans;         /* [slot], or NULL: edges by their envelope, as proposals' targets have them */
    struct notes *notes;        /* [slot] what is known of its simplices, or NULL */
    struct quadrics quadrics;
    const struct limit *asked;  /* a limit that is asked about the winners of a round, or NULL */
    enum metric metric;         /* the order */
    unsigned contract;
    bool named;                 /* levels are named after this rung */
    const struct kernels *kernels;
    struct worker *workers; /* [pool_size] */
    struct pool *pool;
    double *factors; /* [component] */
    double limit;    /* of the rung */
    const double *certified; /* [component] the errors that the rounds before have come to, fractions of the range */
    uint32_t round;
    const struct tetlodi_box *box; /* of the piece's cell, which no tetrahedron leaves; NULL: there is none */
};

/* Rows of the worker's numbers: `gap` U - L at the vertex, `upper` and `lower` of the result, `rise` U and L of the
 * other end less the vertex's (two for each component), `mean` of what the star's interpolants of U and L say at the
 * result. */
enum { NUMBERS_GAP, NUMBERS_UPPER, NUMBERS_LOWER, NUMBERS_RISE, NUMBERS_MEAN = 5, NUMBERS };

/* The simplex that a slot proposes to contract, itself first. Returns how many vertices it has. */
static inline uint32_t proposed_simplex(const struct run *run, uint32_t slot, uint32_t simplex[4])
{
    uint32_t count = 1;
    simplex[0] = slot;
    if (!run->plans) {
        simplex[1] = run->proposals[slot].target / 2;
        return 2;
    }
    for (const uint32_t *others = run->plans[slot].others; count < 4 && others[count - 1] != TETLOD_NONE; count++)
        simplex[count] = others[count - 1];
    return count;
}

static inline double *numbers_of(const struct run *run, const struct worker *worker, int row)
{
    return worker->numbers + (size_t)row * run->working->component_count;
}

#endif
