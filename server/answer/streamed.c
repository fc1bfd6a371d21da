/* SPDX-License-Identifier: BSD-3-Clause */
/* The size of such a file is known before, and any range of it can be made by itself; what is kept for it are two numbers a vertex. */
#include "server/answer/streamed.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "format/fail.h"
#include "server/answer/obtain.h"
#include "server/answer/respond.h"
#include "src/forest/forest.h"
#include "src/util/array.h"

/* A view on its way to a worker. */
struct viewing {
    struct site *site;
    struct cache_entry *forest; /* held */
    uint32_t level;
};

/* A file on its way to a client. */
struct file {
    struct cache *cache;
    struct cache_entry *forest, *view; /* held; the view reads the forest */
    struct io_layout *layout;
    struct io_rows rows;
};

static void free_viewing(void *opaque)
{
    struct viewing *viewing = opaque;
    cache_release(viewing->site->memory, viewing->forest);
    free(viewing);
}

static void free_view(void *opaque)
{
    forest_view_free(opaque);
}

static enum tetlod_status make_view(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct viewing *viewing = opaque;
    const struct forest *forest = forest_of(viewing->forest);
    struct forest_view *view;
    TETLOD_TRY(forest_view_new(&view, forest, viewing->level, error));
    metrics_count(viewing->site->metrics, METRIC_LEVELS_MADE);
    *out = (struct cache_value){view, (size_t)forest_view_bytes(forest, viewing->level), free_view};
    return TETLOD_OK;
}

static void free_file(void *opaque)
{
    struct file *file = opaque;
    cache_release(file->cache, file->view);
    cache_release(file->cache, file->forest);
    io_layout_free(file->layout);
    free(file);
}

static bool read_file(void *opaque, uint64_t begin, size_t size, unsigned char *out)
{
    struct file *file = opaque;
    io_layout_read(file->layout, &file->rows, begin, size, out);
    return true;
}

/* The view of a level as an entry that the caller releases. A view that is kept does not keep its forest: its key names the one
 * forest that it reads. */
static enum outcome obtain_view(struct exchange *exchange, const struct streamed_answer *answer, const struct tetlod_info *info,
                                struct cache_entry *forest, struct cache_entry **out)
{
    struct site *site = exchange->site;
    struct viewing *viewing = array_new(1, sizeof *viewing);
    const struct cache_value *value;
    char key[120];
    *out = NULL;
    if (!viewing) {
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    cache_hold(site->memory, forest);
    *viewing = (struct viewing){site, forest, answer->level};
    snprintf(key, sizeof key, "%s/view/%" PRIu64 "/%" PRIu32, info->cid, forest_serial(forest), answer->level);
    const struct recipe recipe = {make_view, free_viewing, viewing, forest_view_bytes(forest_of(forest), answer->level), PATIENCE, NULL};
    enum outcome outcome = obtain(exchange, site->memory, key, &recipe, &value);
    if (value)
        *out = obtain_take(exchange->request, value);
    return outcome;
}

/* Takes over the two entries, also on failure. */
static bool respond(struct exchange *exchange, const struct streamed_answer *answer, struct cache_entry *forest, struct cache_entry *view)
{
    struct tetlod_error error = {0};
    struct tetmesh shape = {0};
    struct file *file = array_zero(1, sizeof *file);
    struct cache *memory = exchange->site->memory;
    if (!file) {
        cache_release(memory, view);
        cache_release(memory, forest);
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return false;
    }
    *file = (struct file){memory, forest, view, NULL, {cache_value(view, &error)->data, forest_view_values, forest_view_corners}};
    enum tetlod_status status = forest_shape(forest_of(forest), answer->level, &shape, &error);
    if (status == TETLOD_OK)
        status = answer->lay_out(&file->layout, &shape, &error);
    tetmesh_fini(&shape);
    if (status != TETLOD_OK) {
        free_file(file);
        respond_failure(exchange, &error);
        return false;
    }
    response_pieces(exchange->response, answer->media_type, io_layout_size(file->layout), read_file, free_file, file);
    return true;
}

enum outcome answer_streamed(struct exchange *exchange, struct dataset *dataset, const struct streamed_answer *answer)
{
    const struct tetlod_info *info = dataset_info(dataset);
    struct cache_entry *forest, *view;
    char name[80];
    snprintf(name, sizeof name, "%s-%" PRIu32 "-%s", info->cid, answer->level, answer->name);
    const struct representation representation = {.media_type = answer->media_type, .etag = name};
    if (!respond_unchanged(exchange, &representation, SIZE_UNKNOWN)) {
        enum outcome outcome = obtain_forest(exchange, dataset, answer->level, &forest);
        if (!forest)
            return outcome;
        outcome = obtain_view(exchange, answer, info, forest, &view);
        if (!view) {
            cache_release(exchange->site->memory, forest);
            return outcome;
        }
        if (!respond(exchange, answer, forest, view))
            return ANSWERED;
        respond_representation(exchange->response, &representation);
        response_header_text(exchange->response, "Server-Timing", "cache;desc=none");
    }
    cache_forever(exchange);
    if (exchange->response->status == 200)
        level_headers(exchange->response, dataset, answer->level);
    return ANSWERED;
}
