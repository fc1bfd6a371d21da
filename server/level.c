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
    struct dataset *dataset;
    struct metrics *metrics;
};

static void decode_free(void *opaque)
{
    struct decode *decode = opaque;
    dataset_release(decode->dataset);
    free(decode);
}

static void free_forest(void *data)
{
    forest_free(data);
}

static enum tetlod_status decode_make(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct decode *decode = opaque;
    struct forest *forest;
    enum tetlod_status status = forest_build(&forest, dataset_file(decode->dataset), error);
    if (status != TETLOD_OK)
        return status;
    metrics_count(decode->metrics, METRIC_STREAMS_DECODED);
    *out = (struct cache_value){forest, (size_t)forest_bytes(forest), free_forest};
    return TETLOD_OK;
}

enum outcome obtain_forest(struct exchange *exchange, struct dataset *dataset, const struct forest **out)
{
    const struct tetlod_info *info = dataset_info(dataset);
    const struct cache_value *value;
    struct decode *decode = array_new(1, sizeof *decode);
    *out = NULL;
    if (!decode) {
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    *decode = (struct decode){dataset_hold(dataset), exchange->site->metrics};
    /* Two streams with the same content are decoded once; the id keeps their keys apart where files come and go. */
    char key[ID_CAPACITY + 40];
    snprintf(key, sizeof key, "%s/%s", info->cid, dataset_id(dataset));
    const struct recipe recipe = {decode_make, decode_free, decode, 64 * (uint64_t)info->vertices + 16 * (uint64_t)info->tets, PATIENCE};
    enum outcome outcome = obtain(exchange, exchange->site->forests, key, &recipe, &value);
    if (value)
        *out = value->data;
    return outcome;
}
