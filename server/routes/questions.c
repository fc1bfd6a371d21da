/* SPDX-License-Identifier: BSD-3-Clause */
/* Questions about a stream's original. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/conditions.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/jobs/json_body.h"
#include "server/jobs/kept_levels.h"
#include "server/jobs/obtain.h"
#include "server/routes/handlers.h"
#include "server/routes/steps.h"
#include "src/stream/forest.h"
#include "src/report/ask_json.h"
#include "src/util/array.h"
#include "src/util/hash.h"

enum { TEXT_CAPACITY = 512, BLOCK_BYTES = 144 }; // of a tetrahedron that is put into blocks, and searched

struct ask_context {
    struct dataset *dataset;
    struct cache *memory; /* the site's */
    enum coding coding;
    char text[TEXT_CAPACITY];
    struct ask_question question;
    struct ask_options options;
    struct step_selection step;
    bool of_step;
};

static void free_context(void *opaque)
{
    struct ask_context *context = opaque;
    dataset_release(context->dataset);
    free(context);
}

static bool wanted(void *run)
{
    return run_wanted(run);
}

static enum tetlod_status make_answer(void *opaque, struct run *run, struct cache_value *out,
                                      struct tetlod_error *error)
{
    struct ask_context *context = opaque;
    struct tetlod_file *file = dataset_file(context->dataset);
    const struct tetlod_info *info = tetlod_info(file);
    struct ask_options options = context->options;
    struct ask_result result;
    options.wanted = wanted;
    options.opaque = run;
    struct kept_levels kept;
    kept_levels_begin(&kept, context->memory, info->cid);
    options.shelf = &kept.shelf;
    enum tetlod_status status = ask_stream(file, info->level_count - 1, &context->question,
                                           context->of_step ? &context->step : NULL, &options, &result, error);
    kept_levels_end(&kept);
    if (status == TETLOD_ERR_CANCELLED)
        return fail_unwanted(error);
    if (status == TETLOD_ERR_FIELD) // no level certifies the field: the request is right, there is no answer
        return error->status = TETLOD_ERR_ARGUMENT;
    TETLOD_TRY(status);
    return json_body(ask_json(info, context->text, &context->question, &result), context->coding, out, error);
}

/* Reads the question and the width; false after a 400. */
static bool take_question(struct exchange *exchange, const struct tetlod_info *info, struct ask_context *context)
{
    struct response *response = exchange->response;
    const char *target = exchange->request->target;
    struct tetlod_error error = {0};
    char width[64] = "1%";
    if (!check_parameters(exchange))
        return false;
    if (query_value(exchange->query, "q", context->text, sizeof context->text) != QUERY_FOUND) {
        response_problem(response, 400, target,
                         "ask a question: q=mean(Pressure), percent-encoded, of less than %d bytes",
                         TEXT_CAPACITY);
        return false;
    }
    enum tetlod_status status = ask_parse(context->text, &context->question, &error);
    if (status != TETLOD_OK && strchr(context->text, '+')) { // in what forms write it is a blank
        query_form_value(exchange->query, "q", context->text, sizeof context->text);
        status = ask_parse(context->text, &context->question, &error);
    }
    if (status == TETLOD_OK)
        status = ask_check(info, &context->question, &error);
    if (status != TETLOD_OK) {
        response_problem(response, 400, target, "%s", error.message);
        return false;
    }
    if (query_value(exchange->query, "within", width, sizeof width) == QUERY_BAD ||
        !ask_parse_within(width, &context->options)) {
        response_problem(response, 400, target,
                         "within is a width in the answer's units, or a percentage such as 1%%25");
        return false;
    }
    enum query_result by_step = query_step_selection(exchange, context->dataset, &context->step);
    context->of_step = by_step == QUERY_FOUND;
    return by_step != QUERY_BAD;
}

static enum outcome answer(struct exchange *exchange, struct ask_context *context)
{
    struct dataset *dataset = context->dataset;
    const struct tetlod_info *info = dataset_info(dataset);
    const enum coding coding = context->coding;
    char key[TEXT_CAPACITY + 192], step[64] = "", etag[128];
    uint64_t bytes = forest_estimate(info, info->level_count - 1) + BLOCK_BYTES * info->tets;
    if (context->of_step)
        snprintf(step, sizeof step, "%d %.17g %llu", context->step.by_time, context->step.time,
                 (unsigned long long)context->step.step);
    snprintf(key, sizeof key, "%s/ask/%s/%d/%.17g/%s/%s", info->cid, coding_name(coding), context->options.relative,
             context->options.width, step, context->text);
    snprintf(etag, sizeof etag, "%s-ask-%016llx-" TETLOD_VERSION_STRING, info->cid,
             (unsigned long long)hash_text(HASH_START, key));
    const struct job job = {make_answer, free_context, context, bytes, MAX_WAIT_SECONDS, NULL, 0};
    return answer_json(exchange, cache_for(exchange->site, bytes), key, etag, coding, &job);
}

enum outcome handle_ask(struct exchange *exchange)
{
    struct ask_context *context = array_zero(1, sizeof *context);
    if (!context)
        return respond_no_memory(exchange);
    context->dataset = dataset_hold(exchange->dataset);
    context->memory = exchange->site->memory;
    context->coding = coding_choose(request_header(exchange->request, "Accept-Encoding"), CODINGS_MADE);
    if (take_question(exchange, dataset_info(exchange->dataset), context))
        return answer(exchange, context);
    free_context(context);
    return ANSWERED;
}
