/* SPDX-License-Identifier: BSD-3-Clause */
/* Features of a stream's original: the coarsest level that proves or excludes all of them. */
#ifndef TETLOD_FEATURE_LEVELS_H
#define TETLOD_FEATURE_LEVELS_H

#include "src/ask/features.h"
#include "src/ask/question.h"

struct feature_request {
    struct ask_quantity quantity;
    double persistence;    /* a fraction of the range, or in the quantity's units */
    bool absolute;
    bool has_above, has_below; /* instead of maxima and minima: components above and below these */
    double above, below;
    uint32_t first, last;  /* levels that may be taken */
    bool (*wanted)(void *opaque); /* asked before each level: false ends it with ERR_CANCELLED; may be NULL */
    void *opaque;
};

struct feature_answer {
    struct features features;
    double persistence; /* in the quantity's units */
    double range[2];    /* of the quantity in the original, as far as the index says */
    double error;       /* the largest difference from the original at the level */
    uint32_t level, tets; /* TETLOD_NONE: a mesh file */
    uint64_t bytes;     /* that a client reads for it */
};

/* Reads a field's name, one of `names` as it is, or what `ask` takes: |v|, v:1, "a b":0. ERR_ARGUMENT. */
TETLOD_CHECKED enum tetlod_status feature_quantity(const char *text, bool is_name, struct ask_quantity *out,
                                                   struct tetlod_error *error);

/* Of the levels whose domain is the original's and whose error is certified, the coarsest that leaves nothing merely
 * possible; else the finest. ERR_FIELD if there is no such field or component, or no such level, with the reason;
 * ERR_TRUNCATED; or as the cursor. The answer is to be released, also after a failure. */
TETLOD_CHECKED enum tetlod_status features_of_stream(struct tetlod_file *file, const struct feature_request *request,
                                                     struct feature_answer *out, struct tetlod_error *error);

/* The same of a mesh that is known exactly. */
struct feature_values {
    const double *positions;
    const uint32_t *corners;
    uint32_t vertices, tets, components;
    const double *values; /* [components * vertices] */
};
TETLOD_CHECKED enum tetlod_status features_of_mesh(const struct feature_values *mesh,
                                                   const struct feature_request *request, struct feature_answer *out,
                                                   struct tetlod_error *error);

void feature_answer_fini(struct feature_answer *answer);

#endif
