/* SPDX-License-Identifier: BSD-3-Clause */
/* What a level promises, field by field, as the command line and the server say it. */
#ifndef TETLOD_PROMISE_H
#define TETLOD_PROMISE_H

#include <stddef.h>

#include <jansson.h>

#include "format/tetlod.h"

/* The fields of a stream that are not controlled, without local bounds and ids, and the one of them that is furthest
 * off at a level. */
struct uncontrolled {
    uint32_t count, worst; /* worst: TETLOD_NONE where there is none */
    double sampled;        /* its measured error, a fraction of its range */
};

struct uncontrolled uncontrolled_at(const struct tetlod_info *info, uint32_t level);

/* Percent of a fraction to three digits, rounded up: a promise is not rounded down. */
double promise_percent(double fraction);

/* "VonMises ≤ 1 % (certified); 9 fields not controlled, worst Stress 31.9 % (measured)". Cut off at `size` bytes. */
void promise_print(const struct tetlod_info *info, uint32_t level, char *out, size_t size);

/* One field: "Pressure ≤ 1 % of the range, 0.097 in its units (certified)". Rounded up. `ids`: as metadata_ids says. */
void promise_of_field(const struct tetlod_info *info, uint32_t level, uint32_t f, const json_t *ids, char *out,
                      size_t size);

#endif
