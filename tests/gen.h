/* SPDX-License-Identifier: BSD-3-Clause */
/* Random complexes and contraction sequences over them: for what must work with any. The same seed gives the same. */
#ifndef TETLOD_GEN_H
#define TETLOD_GEN_H

#include "tests/recode.h"

enum gen_kind {
    GEN_GRID,   /* cubes of six tetrahedra */
    GEN_HOLES,  /* the same with tetrahedra missing: boundaries, several components, vertices that touch */
    GEN_SOUP,   /* any four vertices: faces of many tetrahedra, tetrahedra listed twice, both orientations */
    GEN_HUB,    /* one vertex is in all tetrahedra */
    GEN_KINDS
};

struct gen_options {
    enum gen_kind kind;
    uint64_t seed;
    uint32_t size;      /* cubes along an edge; a soup has its cube of tetrahedra */
    uint32_t levels;    /* at most */
    unsigned arity;     /* most vertices that one contraction takes: 2 to 4 */
    enum tetlod_type type;
    unsigned position_bits; /* 0: lossless */
    /* 0: fields are exact at once; else on grids of so many bits, and exact in the last level */
    unsigned tail_bits;
    int noise;              /* "kinds" has two components more, of a few values with noise in their last digits */
};

/* Random numbers: splitmix64. */
uint64_t gen_random(uint64_t *state);

/* From 0 up to, but without, 1. */
static inline double gen_unit(uint64_t *state)
{
    return (double)(gen_random(state) >> 11) * 0x1p-53;
}

/* A sequence with two fields: "id", float64, the number of each node; and "value" of two components. With tail_bits
 * also "kinds", float64, of a few values, the same again, two decimals and six digits; and "narrow", float64 of float32
 * values. False: out of memory. */
int gen_make(struct recode *out, const struct gen_options *options);

/* The sequence as a stream, in a file. */
int gen_write(const char *path, const struct gen_options *options);

/* Frees what gen_make made. */
void gen_free(struct recode *recode);

#endif
