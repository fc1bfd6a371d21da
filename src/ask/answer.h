/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What a level tells about its original: an interval that holds the original's own answer.
 *
 * On a level whose domain is the original's, the original's value differs at every point from the level's by at most
 * the certified error (PROOF.md 2). So it lies between two functions, the level's minus and plus its error. Every
 * answer here rises with the function that it is asked of, so the answers for these two enclose it. Where the boundary
 * has moved, all of this holds but for a set that is no larger than the volume that the boundary has swept (PROOF.md
 * 12): sums allow for that set. Extremes and values at places are asked of levels whose boundary has kept its place. */
#ifndef TETLOD_ANSWER_H
#define TETLOD_ANSWER_H

#include "src/ask/blocks.h"
#include "src/ask/question.h"

/* A level as a question sees it; all is borrowed. */
struct ask_level {
    const double *positions;  /* [3 * vertices] */
    const uint32_t *corners;  /* [4 * tets] */
    uint32_t tets;
    const double *values;     /* [components * vertices] of the quantity's field; NULL: volume() asks for none */
    uint32_t components;
    const double *bounds;     /* [vertices] the field's local bound (SPEC 3.3), or NULL */
    double error;             /* of the worst component at any point, in the field's units */
    const double *regions;    /* [tets] numbers of regions, or NULL */
    const uint32_t *numbers;  /* [tets] where a tetrahedron's region is */
    const struct ask_blocks *blocks; /* of its tetrahedra */
    double range[2];          /* of the quantity in the original */
    /* volume that the boundary has swept between the original and the level; 0: it kept its place */
    double swept;
    double volume;            /* of the original, if that is known; else NaN */
};

struct ask_interval {
    double lower, upper;
};

/* Rounding is within the interval: 4e-12 of the sum of what is added. `volume`: that of what is asked about is no
 * larger, but for points and lines. ERR_ARGUMENT if the point, line, box or region holds nothing of the mesh; or
 * ERR_NOMEM. Costs O(tets). */
TETLOD_CHECKED enum tetlod_status ask_answer(const struct ask_question *question, const struct ask_level *level,
                                             struct ask_interval *out, double *volume, struct tetlod_error *error);

/* A predicate's answer: 1 yes, 0 no, -1 the interval does not say. */
int ask_decide(const struct ask_question *question, const struct ask_interval *interval);

#endif
