/* SPDX-License-Identifier: BSD-3-Clause */
/* Fields and what each may differ by: a tolerance file, a line each, or options. */
#ifndef TETLOD_DIFF_LIMITS_H
#define TETLOD_DIFF_LIMITS_H

#include "src/diff/decide.h"

struct diff_limit {
    char *field, *limit; /* owned; limit: NULL for none */
    enum diff_norm norm;
};

/* Begins zeroed. */
struct diff_limits {
    struct diff_limit *limits;
    size_t count, capacity;
};

/* ERR_IO, ERR_ARGUMENT with the file and the line, ERR_NOMEM. To be released, also after a failure. */
TETLOD_CHECKED enum tetlod_status diff_limits_read(struct diff_limits *out, const char *path,
                                                   struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status diff_limits_one(struct diff_limits *out, const char *field, const char *limit,
                                                  enum diff_norm norm, struct tetlod_error *error);
void diff_limits_fini(struct diff_limits *limits);

#endif
