/* SPDX-License-Identifier: BSD-3-Clause */
/* Levels as mesh files, and the stream's own bytes: prefixes, records, the whole. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/reader.h"
#include "server/level.h"
#include "src/util/array.h"

static enum tetlod_status write_mesh(const void *choice, const struct tetmesh *mesh, struct buffer *out, struct tetlod_error *error)
{
    const struct mesh_format *format = choice;
    struct tetlodi_sink sink = buffer_sink(out);
    return format->write(mesh, &sink, error);
}

/* At most: both formats are binary. */
static uint64_t mesh_file_bytes(const struct tetlod_info *info, uint32_t level)
{
    uint64_t components = 3;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return info->levels[level].vertices * components * 8 + info->levels[level].tets * (uint64_t)25 + 4096;
}

/* What is under a content id never changes. */
static enum outcome keep(struct exchange *exchange, enum outcome outcome)
{
    if (outcome == ANSWERED && exchange->response->status == 200)
        cache_forever(exchange->response);
    return outcome;
}

static enum outcome respond_level_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level)
{
    const struct tetlod_info *info = dataset_info(dataset);
    char etag[80];
    snprintf(etag, sizeof etag, "%s-%" PRIu32 "-tetlod", info->cid, level);
    return respond_stored(exchange, dataset, 0, info->levels[level].end, etag);
}

static enum outcome answer_mesh(struct exchange *exchange, struct dataset *dataset, uint32_t level, const struct mesh_format *format)
{
    const struct tetlod_info *info = dataset_info(dataset);
    const struct level_answer answer = {level, format->name, format->media_type, mesh_file_bytes(info, level),
                                        write_mesh, format, sizeof *format};
    if (format->write)
        return answer_from_level(exchange, dataset, &answer);
    enum outcome outcome = keep(exchange, respond_level_prefix(exchange, dataset, level));
    if (outcome == ANSWERED && exchange->response->status == 200)
        level_headers(exchange->response, dataset, level);
    return outcome;
}

enum outcome handle_level_mesh(struct exchange *exchange)
{
    static const char *const none[] = {NULL};
    struct dataset *dataset = captured_dataset(exchange);
    enum outcome outcome = ANSWERED;
    uint32_t level;
    if (!dataset)
        return ANSWERED;
    const struct tetlod_info *info = dataset_info(dataset);
    const struct mesh_format *format = mesh_format_find(exchange->captures[3]);
    if (!format)
        respond_bad_format(exchange, mesh_formats, exchange->captures[3]);
    else if (check_parameters(exchange, none) && parse_level(exchange, info, exchange->captures[2], &level))
        outcome = answer_mesh(exchange, dataset, level, format);
    dataset_release(dataset);
    return outcome;
}

/* Which fields a list of names selects, as text of 0 and 1 for the entity tag. */
static bool select_fields(struct exchange *exchange, const struct tetlod_info *info, char *list, char *selected)
{
    memset(selected, '0', info->field_count);
    selected[info->field_count] = 0;
    for (char *name = list, *next; name && *list; name = next) {
        next = strchr(name, ',');
        if (next)
            *next++ = 0;
        uint32_t field = tetlod_field_index(info, name);
        if (field == TETLOD_NONE) {
            response_problem_choices(exchange->response, 400, exchange->request->target, "fields", field_names(info),
                                     "there is no field '%.128s'; fields are separated by commas", name);
            return false;
        }
        selected[field] = '1';
    }
    return true;
}

/* Header and index if they are asked for, then the frames of levels first .. last: geometry and the selected fields, in the
 * order of the stream. */
static enum outcome answer_frames(struct exchange *exchange, struct dataset *dataset, bool index_too, uint32_t first,
                                  uint32_t last, const char *selected)
{
    const struct tetlodi_index *index = &dataset_file(dataset)->index;
    uint32_t fields = index->info.field_count;
    struct span *spans = array_new(1 + (size_t)(last - first + 1) * (1 + fields), sizeof *spans);
    size_t count = 0;
    if (!spans) {
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    if (index_too)
        spans[count++] = (struct span){0, index->info.levels[0].offset};
    for (uint32_t k = first; k <= last; k++)
        for (uint32_t part = 0; part <= fields; part++)
            if (!part || selected[part - 1] == '1') {
                const struct tetlodi_frame *frame = &index->frames[(size_t)k * (1 + fields) + part];
                spans[count++] = (struct span){frame->offset, frame->size};
            }
    char etag[80 + MOST_FIELDS];
    snprintf(etag, sizeof etag, "%s-%s%" PRIu32 "-%" PRIu32 "-%s", index->info.cid, index_too ? "i" : "", first, last, selected);
    enum outcome outcome = respond_spans(exchange, dataset, spans, count, etag);
    free(spans);
    return outcome;
}

/* The list of fields that the query has, as select_fields makes it; QUERY_BAD: answered. */
static enum query_result query_fields(struct exchange *exchange, const struct tetlod_info *info, char *selected)
{
    char list[1024];
    enum query_result result = query_value(exchange->query, "fields", list, sizeof list);
    if (result == QUERY_BAD)
        response_problem(exchange->response, 400, exchange->request->target, "fields is one list of names");
    else if (result == QUERY_FOUND && !select_fields(exchange, info, list, selected))
        result = QUERY_BAD;
    return result;
}

enum outcome respond_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level)
{
    char selected[MOST_FIELDS + 1];
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
    char selected[MOST_FIELDS + 1], etag[80];
    enum query_result result = query_fields(exchange, info, selected);
    if (result == QUERY_FOUND)
        return keep(exchange, answer_frames(exchange, dataset, false, from + 1, to, selected));
    if (result == QUERY_BAD)
        return ANSWERED;
    uint64_t offset = info->levels[from + 1].offset;
    snprintf(etag, sizeof etag, "%s-%" PRIu32 "-%" PRIu32, info->cid, from, to);
    return keep(exchange, respond_stored(exchange, dataset, offset, info->levels[to].end - offset, etag));
}

enum outcome handle_records(struct exchange *exchange)
{
    static const char *const names[] = {"fields", NULL};
    struct dataset *dataset = captured_dataset(exchange);
    enum outcome outcome = ANSWERED;
    uint32_t from, to;
    if (!dataset)
        return ANSWERED;
    const struct tetlod_info *info = dataset_info(dataset);
    if (check_parameters(exchange, names) && parse_level(exchange, info, exchange->captures[2], &from) &&
        parse_level(exchange, info, exchange->captures[3], &to)) {
        if (from >= to)
            response_problem(exchange->response, 400, exchange->request->target,
                             "records go from a level to a finer one, not from %" PRIu32 " to %" PRIu32, from, to);
        else
            outcome = answer_records(exchange, dataset, from, to);
    }
    dataset_release(dataset);
    return outcome;
}

enum outcome handle_stream(struct exchange *exchange)
{
    static const char *const none[] = {NULL};
    struct dataset *dataset = captured_dataset(exchange);
    enum outcome outcome = ANSWERED;
    if (!dataset)
        return ANSWERED;
    const struct tetlod_info *info = dataset_info(dataset);
    if (check_parameters(exchange, none))
        outcome = keep(exchange, respond_stored(exchange, dataset, 0, info->bytes, info->cid));
    dataset_release(dataset);
    return outcome;
}
