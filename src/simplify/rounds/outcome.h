/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a contraction comes to: U and L of its result with the proof's slack (PROOF.md, 2 and 4), the values that the
 * order chooses, and the error with them.
 */
#ifndef TETLOD_OUTCOME_H
#define TETLOD_OUTCOME_H

#include "src/simplify/rounds/run.h"

/* A simplex, and where contracting it leads. */
struct join {
    uint32_t simplex[4], count; /* the last vertex gets the result */
    bool at_one_point;          /* nothing moves */
    double p[3];
};

static inline uint32_t join_kept(const struct join *join)
{
    return join->simplex[join->count - 1];
}

/* Lists the star of the simplex in the worker. False: no memory. */
bool outcome_list(const struct run *run, struct worker *worker, const struct join *join);

/* Of a listed star: weights of p. False: a tetrahedron would not be well oriented. */
bool outcome_weigh(const struct run *run, struct worker *worker, const struct join *join);

/* U and L of the result in the worker's numbers, and the mean of what the star says. */
void outcome_bounds(const struct run *run, struct worker *worker, const struct join *join);

/* The star's bounds for all values that the slots have (of controlled components only). */
void outcome_say(const struct run *run, const struct worker *worker, const struct join *join, bool controlled_only);

/* Its bounds for the value with this number, at [number % WIDE]. */
static inline const struct star_values *outcome_star_values(const struct worker *worker, uint32_t number)
{
    return &worker->star_values[number / WIDE];
}

/* Widens U and L of the result by the map's demands. */
void outcome_demands(const struct run *run, struct worker *worker);

/* The error of the result with the middles of U and L, as the fields' types can hold them; and these, if wanted. */
double outcome_middles(const struct run *run, const struct worker *worker, double *values);

/* The values that the order chooses, and the error of its limit with them. `cost` (may be NULL): the quadrics' least
 * there. */
double outcome_values(const struct run *run, const struct worker *worker, const struct join *join, double *values,
                      double *cost);

/* The quadrics' least at p over all values, and of the root of the mean the worst component's as an error: an
 * estimate. */
double outcome_estimate(const struct run *run, const struct join *join, double *cost);

#endif
