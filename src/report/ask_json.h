/* SPDX-License-Identifier: BSD-3-Clause */
/* The JSON object of an answer: the same for `ask --json` and for /v1/meshes/{id}/ask. */
#ifndef TETLOD_ASK_JSON_H
#define TETLOD_ASK_JSON_H

#include <jansson.h>

#include "src/ask/ask.h"

/* The unit of what is asked about: the field's, as the metadata say; of volumes and integrals "". */
const char *ask_unit(const json_t *metadata, const struct ask_question *question);

/* "yes", "no" or "unknown"; NULL if the question is no predicate. */
const char *ask_verdict(const struct ask_question *question, const struct ask_interval *interval);

/* A new object, or NULL if memory is out. `text` is the question. */
json_t *ask_json(const struct tetlod_info *info, const char *text, const struct ask_question *question,
                 const struct ask_result *result);

#endif
