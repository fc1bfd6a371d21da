/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The arithmetic over a star, four tetrahedra at a time. Built twice, for any processor and for those with AVX2: both
 * give the same bits (src/util/wide.h).
 */
#ifndef TETLOD_KERNELS_H
#define TETLOD_KERNELS_H

#include "src/simplify/mesh/star_data.h"

/* The first plane of the i-th tetrahedron and the next three (i is a multiple of four); the others are WIDE behind each
 * other. */
static inline double *planes_at(const struct star_data *data, uint32_t components, uint32_t i)
{
    return data->planes + plane_count(components) * i;
}

/* What is asked about the edge to a neighbour. */
struct edge_query {
    uint32_t components;
    const double *factors; /* [component] error of the limit's kind per value */
    const double *gaps;    /* [component] U - L at the vertex */
    double part;           /* of the edge: 1 for the neighbour's position, 0.5 if the middle is possible, too */
    double most;           /* a greater error is not followed */
};

struct edge_answer {
    double error;     /* of part of the edge, by this star alone */
    bool followed;    /* false: it got above `most`, and the rest is not known */
    uint32_t turned;  /* tetrahedra that are turned over at the neighbour's position: at least those that vanish */
    uint32_t half_turned; /* not 0: one is at the middle */
};

/* The other half of a middle: the star of the neighbour. */
struct half {
    /* [component] in: what the vertex's star says at the middle, less the vertex's own; out: both stars */
    double *upper, *lower;
    const double *rise;    /* [2 * component] U and L of the neighbour less the vertex's */
    double error;          /* out */
};

/* A contraction's star, both ends', with the weights of the result's position in every tetrahedron. */
struct weighing {
    uint32_t count;
    size_t room;
    const double **rows[4]; /* [tet] of the corners; the first is the end that it is at */
    uint32_t (*slots)[4];   /* [tet] the same corners */
    uint8_t *moves;         /* [tet] it is kept, with the first corner moved */
    double *weights[3];     /* [tet] out: of the other corners */
    double *shares;         /* [tet] of it in a mean, together 1: the less the further it is continued */
    double *spread;         /* [tet] out: rounding of a value per difference of values (PROOF.md, 4) */
};

/* What the interpolants of a weighed star say at the result of columns of its rows, each widened by its rounding
 * (PROOF.md, 4): at most of an upper bound, at least of a lower one; and the mean, by shares. */
struct bounds {
    double upper[WIDE], lower[WIDE], mean[WIDE];
};

/* The same of values that stand together, without rounding; and the least and the greatest at the star's vertices. */
struct star_values {
    double least[WIDE], greatest[WIDE], mean[WIDE], low[WIDE], high[WIDE];
};

struct kernels {
    /* Rows and planes of a gathered star none of whose tetrahedra is degenerate. */
    void (*prepare)(struct star_data *data, const struct working *working);
    /* What the star says at a neighbour. data->reach of it is set. */
    struct edge_answer (*query_edge)(const struct star_data *data, uint32_t neighbour, const struct edge_query *query,
                                     uint32_t stride);
    /* Lists in data->doubtful the tetrahedra that may turn over where the vertex moves by r; the others surely do not.
     * Returns how many. */
    uint32_t (*doubt)(struct star_data *data, uint32_t components, const double r[3]);
    /* The star of `from` at the middle of its edge to `to`. False: a tetrahedron is turned over there. */
    bool (*halfway)(const struct working *working, uint32_t from, uint32_t to, const struct edge_query *query,
                    struct half *half);
    /* Weights of p. False: a kept tetrahedron would not be well oriented. */
    bool (*weigh)(struct weighing *weighing, const double p[3]);
    /* Of WIDE columns of the rows. */
    void (*bound)(const struct weighing *weighing, uint32_t column, struct bounds *out);
    /* Of `count` values, up to WIDE, which each slot has at `values` + stride * slot. */
    void (*values_at)(const struct weighing *weighing, const double *values, size_t stride, uint32_t count,
                      struct star_values *out);
};

extern const struct kernels kernels_plain, kernels_avx2;

/* The ones for this processor. */
const struct kernels *kernels_choose(void);

#endif
