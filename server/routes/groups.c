/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/groups.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/read/reader.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/jobs/stored.h"
#include "server/routes/frames.h"
#include "server/routes/handlers.h"
#include "src/util/array.h"

/* Which of the stream's fields have steps and are asked for, as query_fields says it: without a list, all of them.
 * False: answered. */
static bool take_fields(struct exchange *exchange, const struct dataset *dataset, char selected[static MAX_FIELDS + 1])
{
    const struct tetlod_info *info = dataset_info(dataset);
    enum query_result result = query_fields(exchange, info, selected);
    if (result == QUERY_BAD)
        return false;
    if (result == QUERY_ABSENT)
        memset(selected, '1', info->field_count);
    selected[info->field_count] = 0;
    bool any = false;
    for (uint32_t f = 0; f < info->field_count; f++) {
        if (field_with_steps(dataset, f) == TETLOD_NONE)
            selected[f] = '0';
        any |= selected[f] == '1';
    }
    if (!any)
        response_problem(exchange->response, 400, exchange->request->target, "none of these fields has steps in time");
    return any;
}

/* Of the selected fields the groups that a step is in, behind the spans that are there. */
static size_t add_groups(const struct step_choice *choice, const char *selected, struct tetlod_span *spans,
                         size_t count)
{
    const struct tetlod_series *series = dataset_series(choice->dataset);
    const struct tetlod_series_info *info = tetlod_series_info(series);
    for (uint32_t f = 0; f < info->field_count; f++)
        if (selected[info->fields[f]] == '1')
            spans[count++] = tetlod_step_span(series, f, choice->band, choice->step);
    return count;
}

static enum outcome answer_group(struct exchange *exchange, const struct step_choice *choice)
{
    struct tetlod_span spans[MAX_FIELDS];
    struct dataset *dataset = choice->dataset;
    char selected[MAX_FIELDS + 1], etag[80 + MAX_FIELDS];
    if (!take_fields(exchange, dataset, selected))
        return ANSWERED;
    size_t count = add_groups(choice, selected, spans, 0);
    snprintf(etag, sizeof etag, "%s-b%" PRIu32 "-g%" PRIu32 "-%s", dataset_info(dataset)->cid, choice->band,
             choice->step / TETLOD_STEP_GROUP, selected);
    return answer_immutable(exchange, respond_stored(exchange, dataset, spans, count, etag));
}

static bool take_group(struct exchange *exchange, const struct dataset *dataset, struct step_choice *choice)
{
    uint32_t groups = (tetlod_series_info(dataset_series(dataset))->step_count + TETLOD_STEP_GROUP -
                       1) / TETLOD_STEP_GROUP, group;
    if (!take_number(exchange, exchange->captures[3], "group", groups, &group))
        return false;
    choice->step = group * TETLOD_STEP_GROUP;
    return true;
}

enum outcome handle_group(struct exchange *exchange)
{
    struct step_choice choice;
    if (check_parameters(exchange) && captured_band(exchange, exchange->dataset, &choice) &&
        take_group(exchange, exchange->dataset, &choice))
        return answer_group(exchange, &choice);
    return ANSWERED;
}

enum outcome respond_step_prefix(struct exchange *exchange, const struct step_choice *choice)
{
    static const uint32_t none[1] = {0};
    struct dataset *dataset = choice->dataset;
    const struct tetlod_file *file = dataset_file(dataset);
    const struct tetlod_info *info = tetlod_info(file);
    const struct tetlod_series_info *series = tetlod_series_info(dataset_series(dataset));
    char selected[MAX_FIELDS + 1], etag[80 + MAX_FIELDS];
    if (!take_fields(exchange, dataset, selected))
        return ANSWERED;
    if (series->displacement != TETLOD_NONE) // no field is anywhere without the points
        selected[series->fields[series->displacement]] = '1';
    size_t most = tetlod_spans(file, TETLOD_NONE, choice->level, none, 0, NULL, 0), count = most;
    struct tetlod_span *spans = array_new(most + 1 + info->field_count, sizeof *spans);
    if (!spans)
        return respond_no_memory(exchange);
    tetlod_spans(file, TETLOD_NONE, choice->level, none, 0, spans, most);
    const struct tetlod_section *table = &info->sections[tetlod_section_index(info, "TIME")];
    spans[count++] = (struct tetlod_span){table->offset, table->stored};
    count = add_groups(choice, selected, spans, count);
    snprintf(etag, sizeof etag, "%s-ib%" PRIu32 "-g%" PRIu32 "-%s", info->cid, choice->band,
             choice->step / TETLOD_STEP_GROUP, selected);
    enum outcome outcome = respond_stored(exchange, dataset, spans, count, etag);
    free(spans);
    return outcome;
}
