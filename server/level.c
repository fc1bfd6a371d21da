/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/level.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/io/io.h"
#include "src/util/array.h"

const struct mesh_format mesh_formats[] = {
    {"vtu", "application/vnd.vtk.vtu", io_write_vtu_plain},
    {"vtk", "application/vnd.vtk", io_write_vtk},
    {"tetlod", "application/vnd.tetlod", NULL},
    {NULL, NULL, NULL},
};

const struct mesh_format *mesh_format_find(const char *name)
{
    for (const struct mesh_format *format = mesh_formats; format->name; format++)
        if (strcmp(format->name, name) == 0)
            return format;
    return NULL;
}

void respond_bad_format(struct exchange *exchange, const struct mesh_format *formats, const char *name)
{
    json_t *names = json_array();
    for (; formats->name; formats++)
        json_array_append_new(names, json_string(formats->name));
    response_problem_choices(exchange->response, 400, exchange->request->target, "formats", names,
                             "there is no format '%.64s' here", name);
}

void level_headers(struct response *response, const struct dataset *dataset, uint32_t level)
{
    const struct tetlod_info *info = dataset_info(dataset);
    const char *errors = dataset_level_errors(dataset, level);
    response_header(response, "Tetlod-Level", "%" PRIu32, level);
    response_header(response, "Tetlod-Vertices", "%" PRIu32, info->levels[level].vertices);
    response_header(response, "Tetlod-Tets", "%" PRIu32, info->levels[level].tets);
    if (errors[0])
        response_header_text(response, "Tetlod-Error", errors);
}

struct dataset *captured_dataset(struct exchange *exchange)
{
    const char *id = exchange->captures[0], *cid = exchange->captures[1];
    struct dataset *dataset = catalogue_find_content(exchange->site->catalogue, id, cid, monotonic_seconds());
    if (dataset)
        return dataset;
    struct dataset *current = catalogue_find(exchange->site->catalogue, id);
    if (!current) {
        respond_no_mesh(exchange);
        return NULL;
    }
    json_t *cids = json_array();
    json_array_append_new(cids, json_string(dataset_info(current)->cid));
    response_problem_choices(exchange->response, 404, exchange->request->target, "cid", cids,
                             "'%s' has another content id now; /v1/meshes/{id} tells which", id);
    dataset_release(current);
    return NULL;
}

bool parse_level(struct exchange *exchange, const struct tetlod_info *info, const char *text, uint32_t *out)
{
    uint64_t level;
    if (text_count(text, false, &level) && level < info->level_count) {
        *out = (uint32_t)level;
        return true;
    }
    response_problem(exchange->response, 400, exchange->request->target, "levels go from 0 to %" PRIu32 ", not '%s'",
                     info->level_count - 1, text);
    return false;
}

/* ---- the stream in memory ---- */

struct decode {
    struct site *site;
    struct dataset *dataset; /* held */
};

static bool stopping(void *pool)
{
    return pool_stopping(pool);
}

static void decode(void *opaque)
{
    struct decode *decode = opaque;
    uint32_t finest = dataset_info(decode->dataset)->level_count - 1;
    enum tetlod_status status = decoding_run(dataset_decoding(decode->dataset), finest, stopping, decode->site->decoders, NULL);
    if (status == TETLOD_OK)
        metrics_count(decode->site->metrics, METRIC_STREAMS_DECODED);
    dataset_release(decode->dataset);
    free(decode);
}

/* Who asked has been registered as waiting: on failure it is woken and hears why. */
static void start_decoding(struct site *site, struct dataset *dataset)
{
    struct tetlod_error failure = {.status = TETLOD_ERR_LIMIT, .message = "the server has too much to do"};
    struct decode *context = array_new(1, sizeof *context);
    if (context) {
        *context = (struct decode){site, dataset_hold(dataset)};
        if (pool_submit(site->decoders, decode, context))
            return;
        dataset_release(dataset);
        free(context);
    }
    decoding_cancel(dataset_decoding(dataset), &failure);
}

enum outcome obtain_forest(struct exchange *exchange, struct dataset *dataset, uint32_t level, const struct forest **out)
{
    struct request *request = exchange->request;
    struct decoding *decoding = dataset_decoding(dataset);
    bool here = !request->waiter || !exchange->site->decoders;
    struct tetlod_error failure = {0};
    if ((*out = decoding_find(decoding, level)))
        return ANSWERED;
    enum decoding_state state = decoding_ask(decoding, level, request->waited_for_stream, here ? NULL : request->waiter, &failure);
    if (state == DECODING_MINE && here)
        state = decoding_run(decoding, level, NULL, NULL, &failure) == TETLOD_OK ? DECODING_READY : DECODING_FAILED;
    else if (state == DECODING_MINE)
        start_decoding(exchange->site, dataset);
    if (state == DECODING_READY)
        *out = decoding_find(decoding, level);
    else if (state == DECODING_FAILED)
        respond_failure(exchange, &failure);
    else if (here)
        response_problem(exchange->response, 503, request->target, "this stream is being decoded");
    else {
        request->waited = request->waited_for_stream = true;
        return WAITING;
    }
    return ANSWERED;
}
