/* SPDX-License-Identifier: BSD-3-Clause */
/* The JSON object of a comparison (tetlod diff --json). */
#ifndef TETLOD_DIFF_JSON_H
#define TETLOD_DIFF_JSON_H

#include <jansson.h>

#include "src/diff/decide.h"

/* Tetrahedra of the first mesh where the difference may be as large as it is somewhere, and the box around them. */
struct diff_where {
    uint32_t tets;
    double box[2][3];
};
void diff_where(const struct diff_side *first, const struct diff_result *result, struct diff_where *out);

/* "measured", "within", "undecided", "beyond". */
const char *diff_verdict_name(enum diff_verdict verdict);

/* A new object, or NULL if memory is out. `field` is its name as it was asked for. */
json_t *diff_json(const char *field, const struct diff_side sides[2], const struct diff_options *options,
                  const struct diff_result *result);

#endif
