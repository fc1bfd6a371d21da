/* SPDX-License-Identifier: BSD-3-Clause */
/* Streams that lie: a figure of the index is put below the truth, and the whole sealed again. */
#ifndef TETLOD_ATTACK_FALSIFY_H
#define TETLOD_ATTACK_FALSIFY_H

#include <stdbool.h>
#include <stddef.h>

#include "format/tetlod.h"
#include "tests/attack/shapes.h"

/* What is known to be true, by level: NaN where nothing is. */
struct falsehood {
    double *max;     /* [level * fields + field] the largest component's difference */
    double *sampled; /* the same at original vertices */
    double *domain; /* [level] */
    uint32_t levels, fields;
    bool definite; /* a sample has one value only: nothing overlaps, nothing is almost flat */
};

void falsehood_begin(struct falsehood *falsehood, const struct tetlod_info *info);
void falsehood_end(struct falsehood *falsehood);

/* A difference that was found: the largest counts. */
void falsehood_note(double *at, double difference);

/* Writes the stream with one figure made too small, or, once in eight times, as it was, sealed again; says in `text`
 * which, and whether it is a lie. False: there is none that could be. */
bool falsehood_write(const struct falsehood *falsehood, struct tetlod_file *file, struct dice *dice, const char *path,
                     bool *out_lie, char *text, size_t size);

/* The same with a local bound that is too small everywhere by one factor, and everything in the index that follows from
 * it. False: no field has one that could be. */
bool falsehood_write_bound(const struct falsehood *falsehood, struct tetlod_file *file, const char *path, char *text,
                           size_t size);

#endif
