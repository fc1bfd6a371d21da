/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What the bytes that a page has prove of the original: answers to questions, and features. Beside the meshes that are
 * finer in boxes in one module. server/web/client/answers.js calls the exports.
 */
#ifndef TETLOD_ANSWERS_H
#define TETLOD_ANSWERS_H

#include "server/web/refine/finer.h"

enum {
    ANSWER_NUMBERS = 6,  /* lower, upper, level (-1: the bytes before the levels), exact, tetrahedra, bytes */
    FEATURE_NUMBERS = 14 /* kind, proven, place (3), box (6), range (2), persistence */
};

struct answers;

/* Those that can fail return an enum tetlod_status, which answers_message explains. */
REFINE_EXPORT(answers_new) struct answers *answers_new(void);
REFINE_EXPORT(answers_free) void answers_free(struct answers *answers);
REFINE_EXPORT(answers_message) const char *answers_message(const struct answers *answers);

/* As of a view: which fields the bytes are of, and bytes, one part after the other. */
REFINE_EXPORT(answers_select) uint32_t answers_select(struct answers *answers, const char *names, uint32_t count);
REFINE_EXPORT(answers_add) uint32_t answers_add(struct answers *answers, const void *bytes, uint32_t size);

/* Of levels up to `finest`, the coarsest whose answer to `text` is as narrow as `within` of what it can be at most. */
REFINE_EXPORT(answers_ask)
uint32_t answers_ask(struct answers *answers, const char *text, uint32_t finest, double within);
REFINE_EXPORT(answers_numbers) const double *answers_numbers(const struct answers *answers);

/* Maxima and minima of a quantity whose persistence is above a fraction of the range. */
REFINE_EXPORT(answers_find)
uint32_t answers_find(struct answers *answers, const char *quantity, uint32_t finest, double persistence);
REFINE_EXPORT(answers_feature_count) uint32_t answers_feature_count(const struct answers *answers);
REFINE_EXPORT(answers_features) const double *answers_features(const struct answers *answers);
/* The level that was taken, its error in the quantity's units, and whether there are no other maxima, minima. */
REFINE_EXPORT(answers_found) const double *answers_found(const struct answers *answers);

#endif
