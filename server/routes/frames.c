/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/routes/frames.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/read/reader.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/jobs/stored.h"
#include "server/routes/handlers.h"
#include "src/util/array.h"

enum outcome respond_level_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char etag[80];
    snprintf(etag, sizeof etag, "%s-%" PRIu32 "-tetlod", info->cid, level);
    return respond_stored(exchange, dataset, &(struct tetlod_span){0, info->levels[level].end}, 1, etag);
}

/* Which fields a list of names selects, as text of 0 and 1 for the entity tag. */
static bool select_fields(struct exchange *exchange, const struct tetlod_info *info, char *list, const char *form,
                          char *selected)
{
    memset(selected, '0', info->field_count);
    selected[info->field_count] = 0;
    for (char *at = list; *at;) {
        uint32_t field;
        size_t size = info->field_count ? list_find_either(at, form + (at - list), &info->fields[0].name,
                                                           sizeof *info->fields, info->field_count, &field) : 0;
        if (!size) {
            response_problem_choices(exchange->response, 400, exchange->request->target, "fields", field_names(info),
                                     "there is no field '%.*s'; fields are separated by commas", (int)strcspn(at, ","),
                                     at);
            return false;
        }
        selected[field] = '1';
        at += size;
    }
    return true;
}

/* Header and index if they are asked for, then the frames of levels first .. last: geometry and the selected fields, in
 * the order of the stream. */
static enum outcome answer_frames(struct exchange *exchange, struct dataset *dataset, bool index_too, uint32_t first,
                                  uint32_t last, const char *selected)
{
    const struct tetlod_file *file = dataset_file(dataset);
    const struct tetlod_info *info = tetlod_info(file);
    uint32_t fields[MAX_FIELDS], count = 0, from = index_too ? TETLOD_NONE : first - 1;
    for (uint32_t f = 0; f < info->field_count; f++)
        if (selected[f] == '1')
            fields[count++] = f;
    size_t most = tetlod_spans(file, from, last, fields, count, NULL, 0);
    struct tetlod_span *spans = array_new(most, sizeof *spans);
    if (!spans)
        return respond_no_memory(exchange);
    tetlod_spans(file, from, last, fields, count, spans, most);
    char etag[80 + MAX_FIELDS];
    snprintf(etag, sizeof etag, "%s-%s%" PRIu32 "-%" PRIu32 "-%s", info->cid, index_too ? "i" : "", first, last,
             selected);
    enum outcome outcome = respond_stored(exchange, dataset, spans, most, etag);
    free(spans);
    return outcome;
}

enum query_result query_fields(struct exchange *exchange, const struct tetlod_info *info, char *selected)
{
    char list[8192], form[sizeof list];
    enum query_result result = query_value(exchange->query, "fields", list, sizeof list);
    query_form_value(exchange->query, "fields", form, sizeof form);
    if (result == QUERY_BAD)
        response_problem(exchange->response, 400, exchange->request->target,
                         "fields is one list of names of at most %zu bytes in all", sizeof list - 1);
    else if (result == QUERY_FOUND && !select_fields(exchange, info, list, form, selected))
        result = QUERY_BAD;
    return result;
}

enum outcome respond_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level)
{
    char selected[MAX_FIELDS + 1];
    switch (query_fields(exchange, dataset_info(dataset), selected)) {
    case QUERY_FOUND:
        return answer_frames(exchange, dataset, true, 0, level, selected);
    case QUERY_ABSENT:
        return respond_level_prefix(exchange, dataset, level);
    default:
        return ANSWERED;
    }
}

static enum outcome answer_records(struct exchange *exchange, struct dataset *dataset, uint32_t from, uint32_t to)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char selected[MAX_FIELDS + 1], etag[80];
    enum query_result result = query_fields(exchange, info, selected);
    if (result == QUERY_FOUND)
        return answer_immutable(exchange, answer_frames(exchange, dataset, false, from + 1, to, selected));
    if (result == QUERY_BAD)
        return ANSWERED;
    uint64_t offset = info->levels[from + 1].offset;
    snprintf(etag, sizeof etag, "%s-%" PRIu32 "-%" PRIu32, info->cid, from, to);
    return answer_immutable(exchange,
                            respond_stored(exchange, dataset,
                                           &(struct tetlod_span){offset, info->levels[to].end - offset}, 1, etag));
}

enum outcome handle_records(struct exchange *exchange)
{
    const struct tetlod_info *info = dataset_info(exchange->dataset);
    uint32_t from, to;
    if (!check_parameters(exchange) || !parse_level(exchange, info, exchange->captures[2], &from) ||
        !parse_level(exchange, info, exchange->captures[3], &to))
        return ANSWERED;
    if (from < to)
        return answer_records(exchange, exchange->dataset, from, to);
    response_problem(exchange->response, 400, exchange->request->target,
                     "records go from a level to a finer one, not from %" PRIu32 " to %" PRIu32, from, to);
    return ANSWERED;
}

enum outcome handle_stream(struct exchange *exchange)
{
    const struct tetlod_info *info = dataset_info(exchange->dataset);
    const struct tetlod_span whole = {0, info->bytes};
    if (!check_parameters(exchange))
        return ANSWERED;
    enum outcome outcome =
        answer_immutable(exchange, respond_stored(exchange, exchange->dataset, &whole, 1, info->cid));
    name_download(exchange, ".tetlod");
    return outcome;
}
