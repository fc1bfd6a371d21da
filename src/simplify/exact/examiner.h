/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The exact limit. After a contraction to v' with the value s' the level is linear on every cone of the new star, the
 * original on every tetrahedron: their difference is largest at a corner of an intersection of the two. Those are the
 * original vertices, where original edges cross walls, where spokes cross original faces, v' itself, and points on the
 * link, where nothing changes. Each is |w s' + c| for a weight w of v' and a constant c, so a limit of it is an
 * interval for s' (PROOF.md, 8).
 */
#ifndef TETLOD_EXAMINER_H
#define TETLOD_EXAMINER_H

#include "src/simplify/mesh/star.h"
#include "src/simplify/exact/cover.h"

/* |weight * s' + constant| is the difference at a corner of the overlay. */
struct critical {
    double weight, constant;
    struct sentinel where; /* no tetrahedron: at v' itself, whatever the star */
    bool fixed;    /* no corner but an end of the field's range, which no limit moves */
};

/* The values of v' that are left for one component. */
struct interval {
    double limit;     /* in the field's units: what was asked for, or more where that leaves nothing */
    double asked;
    double low, high; /* at this limit */
    double range[2];  /* that the field's values stay in */
    struct critical lowest, highest; /* that say so */
};

enum { RECENT = 8 };

/* One thread's. */
struct examiner {
    struct cover cover;
    struct sentinel recent[RECENT]; /* points that refused the star's candidates so far */
    uint32_t recent_count;
    struct interval *intervals; /* [component] */
    /* [component] a value of the star: all values here are less it, so that none is larger than they vary */
    double *bases;
    double *level, *original;   /* [component][link], [component][vertex] values */
    double *points;             /* [point][1 + component] weights and constants of all corners of the overlay */
    double *constants;          /* [component] of the current one */
    double *chosen, *errors;    /* [component] as the field has the values; and */
    struct sentinel *places;    /* [point] */
    uint32_t *cones;            /* [point] that it is in; TETLOD_NONE: at v' */
    uint64_t *sets;             /* scratch */
    size_t level_capacity, original_capacity, point_capacity, place_capacity, cone_capacity, set_capacity, point_count;
};

struct finding {
    bool allowed;
    bool large;          /* it was not asked: the star has too many originals in it */
    /* fraction of the range of the worst weighted component; if not allowed, a lower bound of it */
    double error;
    /* if not allowed: while their tetrahedra stay as they are, so does the bound; without one it always does */
    struct sentinel witness[2];
};

TETLOD_CHECKED enum tetlod_status examiner_init(struct examiner *examiner, const struct working *working,
                                                struct tetlod_error *error);
void examiner_fini(struct examiner *examiner);

/* Takes up a gathered star. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status exact_begin(struct examiner *examiner, const struct working *working,
                                              const struct star *star,
                                                struct tetlod_error *error);

/* May the star that was taken up be contracted to p, where no tetrahedron flips, with an error of at most `limit`? Then
 * the components' values are in examiner->chosen, and the error of each, rounding included, is in examiner->errors. A
 * bound is followed to `cutoff` at most, and only if `whole` beyond the kind of corners that refused first.
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status exact_examine(struct examiner *examiner, const struct overlaps *overlaps,
                                                const struct working *working,
                                                const struct star *star, const double p[3], double limit,
                                                double cutoff, bool whole, struct finding *out,
                                                struct tetlod_error *error);

/* After exact_examine has allowed a contraction: what it leaves to its cones, for overlaps_take. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status exact_pass_on(struct examiner *examiner, const struct working *working,
                                                struct passed *out,
                                                struct tetlod_error *error);

#endif
