/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/ask_json.h"

#include "src/stream/metadata.h"

const char *ask_unit(const json_t *metadata, const struct ask_question *question)
{
    bool of_field = question->function != ASK_VOLUME && question->function != ASK_INTEGRAL;
    return of_field ? metadata_unit(metadata, question->quantity.name) : "";
}

const char *ask_verdict(const struct ask_question *question, const struct ask_interval *interval)
{
    static const char *const verdicts[] = {"unknown", "no", "yes"};
    return question->compare == ASK_NO_LIMIT ? NULL : verdicts[ask_decide(question, interval) + 1];
}

json_t *ask_json(const struct tetlod_info *info, const char *text, const struct ask_question *question,
                 const struct ask_result *result)
{
    const char *verdict = ask_verdict(question, &result->interval);
    json_t *metadata = metadata_json(info);
    json_t *object = json_pack("{s:s, s:f, s:f, s:s, s:s, s:I, s:I}", "question", text,
                               "lower", result->interval.lower, "upper", result->interval.upper,
                               "unit", ask_unit(metadata, question), "bound", result->exact ? "exact" : "certified",
                               "bytes", (json_int_t)result->bytes, "of_bytes", (json_int_t)info->bytes);
    if (object && result->level != TETLOD_NONE) {
        json_object_set_new(object, "level", json_integer(result->level));
        json_object_set_new(object, "tets", json_integer(result->tets));
    }
    if (object && result->of_step)
        json_object_set_new(object, "time", json_real(result->time));
    if (object && verdict)
        json_object_set_new(object, "answer", json_string(verdict));
    json_decref(metadata);
    return object;
}
