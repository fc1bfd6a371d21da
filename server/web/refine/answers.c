/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/web/refine/answers.h"

#include <stdlib.h>
#include <string.h>

#include "src/ask/ask.h"
#include "src/ask/feature_levels.h"
#include "format/fail.h"
#include "src/util/array.h"

struct answers {
    struct tetlod_feed *feed;
    char *names; /* of the fields that the bytes are of, each with its end; NULL: of all */
    uint32_t name_count;
    double numbers[ANSWER_NUMBERS], found[4];
    double *features; /* [FEATURE_NUMBERS * feature_count] */
    uint32_t feature_count;
    struct tetlod_error error;
};

struct answers *answers_new(void)
{
    struct answers *answers = array_zero(1, sizeof *answers);
    if (answers && refine_feed_new(&answers->feed, &answers->error) == TETLOD_OK)
        return answers;
    free(answers);
    return NULL;
}

void answers_free(struct answers *answers)
{
    tetlod_feed_free(answers->feed);
    free(answers->features);
    free(answers->names);
    free(answers);
}

const char *answers_message(const struct answers *answers)
{
    return answers->error.message;
}

uint32_t answers_select(struct answers *answers, const char *names, uint32_t count)
{
    size_t size = 0;
    for (uint32_t i = 0; i < count; i++)
        size += strlen(names + size) + 1;
    answers->names = array_new(size, 1);
    if (!answers->names)
        return tetlodi_fail_nomem(&answers->error, "a selection of fields", size);
    memcpy(answers->names, names, size);
    answers->name_count = count;
    return refine_select_names(answers->feed, names, count, &answers->error);
}

uint32_t answers_add(struct answers *answers, const void *bytes, uint32_t size)
{
    return tetlod_feed_add(answers->feed, bytes, size, &answers->error);
}

/* Are the bytes those of the quantity's field, too? */
static enum tetlod_status check_loaded(struct answers *answers, const struct ask_quantity *quantity)
{
    const char *name = answers->names;
    const uint32_t known = tetlod_field_index(tetlod_info(tetlod_feed_file(answers->feed)), quantity->name);
    if (!answers->names || !quantity->name[0] || known == TETLOD_NONE)
        return TETLOD_OK;
    for (uint32_t i = 0; i < answers->name_count; i++, name += strlen(name) + 1)
        if (strcmp(name, quantity->name) == 0)
            return TETLOD_OK;
    return tetlodi_fail(&answers->error, TETLOD_ERR_FIELD, "the field '%.100s' is not loaded: choose it first",
                        quantity->name);
}

uint32_t answers_ask(struct answers *answers, const char *text, uint32_t finest, double within)
{
    const struct ask_options options = {.width = within, .relative = true};
    struct ask_question question;
    struct ask_result result;
    TETLOD_TRY(ask_parse(text, &question, &answers->error));
    TETLOD_TRY(check_loaded(answers, &question.quantity));
    TETLOD_TRY(ask_stream(tetlod_feed_file(answers->feed), finest, &question, NULL, &options, &result,
                          &answers->error));
    const double numbers[ANSWER_NUMBERS] = {result.interval.lower, result.interval.upper,
                                            result.level == TETLOD_NONE ? -1.0 : result.level, result.exact,
                                            result.tets, (double)result.bytes};
    memcpy(answers->numbers, numbers, sizeof numbers);
    return TETLOD_OK;
}

const double *answers_numbers(const struct answers *answers)
{
    return answers->numbers;
}

static void put_feature(double out[FEATURE_NUMBERS], const struct feature *feature)
{
    out[0] = feature->kind;
    out[1] = feature->proven;
    memcpy(out + 2, feature->at, sizeof feature->at);
    memcpy(out + 5, feature->box, sizeof feature->box);
    memcpy(out + 11, feature->range, sizeof feature->range);
    out[13] = feature->persistence;
}

static enum tetlod_status keep_features(struct answers *answers, const struct feature_answer *answer)
{
    const struct features *features = &answer->features;
    free(answers->features);
    answers->features = array_new(features->count, FEATURE_NUMBERS * sizeof *answers->features);
    answers->feature_count = answers->features ? (uint32_t)features->count : 0;
    if (!answers->features)
        return tetlodi_fail_nomem(&answers->error, "the features", features->count * sizeof(struct feature));
    for (uint32_t i = 0; i < answers->feature_count; i++)
        put_feature(answers->features + FEATURE_NUMBERS * (size_t)i, &features->list[i]);
    const double found[] = {answer->level, answer->error, features->bounded[FEATURE_MAXIMUM],
                            features->bounded[FEATURE_MINIMUM]};
    memcpy(answers->found, found, sizeof found);
    return TETLOD_OK;
}

uint32_t answers_find(struct answers *answers, const char *quantity, uint32_t finest, double persistence)
{
    struct feature_request request = {.persistence = persistence, .last = finest};
    struct feature_answer answer = {0};
    TETLOD_TRY(feature_quantity(quantity, false, &request.quantity, &answers->error));
    TETLOD_TRY(check_loaded(answers, &request.quantity));
    enum tetlod_status status = features_of_stream(tetlod_feed_file(answers->feed), &request, &answer,
                                                   &answers->error);
    if (status == TETLOD_OK)
        status = keep_features(answers, &answer);
    feature_answer_fini(&answer);
    return status;
}

uint32_t answers_feature_count(const struct answers *answers)
{
    return answers->feature_count;
}

const double *answers_features(const struct answers *answers)
{
    return answers->features;
}

const double *answers_found(const struct answers *answers)
{
    return answers->found;
}
