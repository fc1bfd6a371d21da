/* SPDX-License-Identifier: BSD-3-Clause */
/* Questions to a stream: about the coarsest level whose answer is narrow enough. */
#ifndef TETLOD_ASK_H
#define TETLOD_ASK_H

#include "src/ask/answer.h"
#include "src/ask/forms.h"

/* Where levels of the stream's own values are kept from one question to the next, with a field, "" for none. */
struct ask_shelf {
    void *opaque;
    /* false: it is not there. What it gives holds until the question is answered. */
    bool (*take)(void *opaque, uint32_t level, const char *field, struct form_mesh *out);
    void (*put)(void *opaque, uint32_t level, const char *field, const struct form_mesh *mesh, uint32_t components);
};

/* How wide an answer may be: in its own units, or relative to what it can be at most: the field's range, the volume, or
 * both. */
struct ask_options {
    double width;
    bool relative;
    bool (*wanted)(void *opaque); /* asked before each level: false ends it with ERR_CANCELLED; may be NULL */
    void *opaque;
    const struct ask_shelf *shelf; /* NULL: each question decodes its levels */
};

/* Reads a width, 0.5 or 1%; false if the text is none. */
bool ask_parse_within(const char *text, struct ask_options *out);

/* Does the stream have the field, and the component, that is asked about? ERR_FIELD. */
TETLOD_CHECKED enum tetlod_status ask_check(const struct tetlod_info *info, const struct ask_question *question,
                                            struct tetlod_error *error);

struct ask_result {
    struct ask_interval interval;
    bool exact;     /* the level is the original in what was asked: only rounding is left */
    uint32_t level; /* TETLOD_NONE: the index said it */
    uint64_t tets, of_tets; /* of that level, and of the stream or the step's topology group */
    uint32_t level_count;
    bool of_step;
    double time;    /* of the step */
    uint64_t bytes; /* that a client reads for it: header, index, levels with the quantity's fields, regions */
};

/* Of a stream's own values, or of those of a step (NULL: none). Levels up to `finest` are there (TETLOD_NONE: none).
 * Of the levels whose domain is the original's (or, for sums, whose boundary has swept a known volume), the coarsest
 * with an answer within the width, or that decides the predicate; else the finest. ERR_FIELD if there is no such
 * field or component, or if no level certifies it; ERR_ARGUMENT as ask_answer; ERR_TRUNCATED; or as the cursor. */
TETLOD_CHECKED enum tetlod_status ask_stream(struct tetlod_file *file, uint32_t finest,
                                             const struct ask_question *question,
                                             const struct step_selection *step, const struct ask_options *options,
                                             struct ask_result *out,
                                             struct tetlod_error *error);

#endif
