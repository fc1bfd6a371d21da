/* SPDX-License-Identifier: BSD-3-Clause */
/* The size of such a file is known before, and any range of it can be made by itself; what is kept for it are two
 * numbers a vertex, and the values of cells that were chosen, which are decoded all at once. A level in pages of a
 * stream that does not fit into memory is decoded page by page into a temporary file. */
#include "server/jobs/streamed.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "format/fail.h"
#include "server/http/respond.h"
#include "server/jobs/obtain.h"
#include "src/stream/forest.h"
#include "src/stream/level_file.h"
#include "src/stream/level_mesh.h"
#include "src/util/array.h"

/* A view on its way to a worker. */
struct view_job {
    struct site *site;
    struct cache_entry *forest; /* held */
    uint32_t level;
};

/* A level on its way into a file. */
struct file_job {
    struct site *site;
    struct dataset *dataset; /* held */
    uint32_t level;
};

/* Values of cells on their way to a worker. */
struct cells_job {
    struct site *site;
    struct dataset *dataset; /* held */
    uint32_t level;
    struct cell_choice choice;
};

/* What a file is written from; all held. The view reads the forest; or there is a level in a file. `cells` is NULL if
 * none were chosen. */
struct held {
    struct cache_entry *forest, *view, *level_file, *cells;
};

/* A file on its way to a client. */
struct file {
    struct cache *cache;
    struct held held;
    struct io_layout *layout;
    struct io_rows rows;
};

static void free_view_job(void *opaque)
{
    struct view_job *view_job = opaque;
    cache_release(view_job->site->memory, view_job->forest);
    free(view_job);
}

static void free_view(void *opaque)
{
    forest_view_free(opaque);
}

static enum tetlod_status make_view(void *opaque, struct run *run, struct cache_value *out, struct tetlod_error *error)
{
    struct view_job *view_job = opaque;
    (void)run;
    const struct forest *forest = forest_of(view_job->forest);
    struct forest_view *view;
    TETLOD_TRY(forest_view_new(&view, forest, view_job->level, error));
    metrics_count(view_job->site->metrics, METRIC_LEVELS_MADE);
    *out = (struct cache_value){view, (size_t)forest_view_bytes(forest, view_job->level), free_view};
    return TETLOD_OK;
}

static void free_file_job(void *opaque)
{
    struct file_job *file_job = opaque;
    dataset_release(file_job->dataset);
    free(file_job);
}

static void free_level_file(void *opaque)
{
    level_file_free(opaque);
}

/* Half of the memory, or what a page needs. What is kept of that, so that there are not many such files. */
enum { DECODING_SHARE = 2, KEPT_SHARE = 16 };

static enum tetlod_status make_level_file(void *opaque, struct run *run, struct cache_value *out,
                                          struct tetlod_error *error)
{
    const struct file_job *file_job = opaque;
    const uint64_t memory = cache_capacity(file_job->site->memory);
    struct level_file *level_file;
    uint64_t bytes;
    TETLOD_TRY(level_file_new(&level_file, dataset_file(file_job->dataset), file_job->level, memory / DECODING_SHARE,
                              &bytes, error));
    enum tetlod_status status = room_take(run_room(run), bytes, error);
    while (status == TETLOD_OK || status == TETLOD_MORE) {
        status = run_wanted(run) ? level_file_grow(level_file, error) : fail_unwanted(error);
        if (status == TETLOD_OK)
            break;
    }
    metrics_count(file_job->site->metrics, METRIC_STREAMS_DECODED);
    if (status == TETLOD_OK)
        *out = (struct cache_value){level_file, (size_t)(memory / KEPT_SHARE), free_level_file};
    else
        level_file_free(level_file);
    return status;
}

static void free_cells_job(void *opaque)
{
    struct cells_job *cells_job = opaque;
    dataset_release(cells_job->dataset);
    free(cells_job);
}

static void free_cells(void *opaque)
{
    tetmesh_fini(opaque);
    free(opaque);
}

static enum tetlod_status make_cells(void *opaque, struct run *run, struct cache_value *out, struct tetlod_error *error)
{
    const struct cells_job *cells_job = opaque;
    (void)run;
    const struct tetlod_info *info = dataset_info(cells_job->dataset);
    struct tetmesh *cells = array_zero(1, sizeof *cells);
    if (!cells)
        return tetlodi_fail_nomem(error, "values of cells", sizeof *cells);
    cells->tet_count = info->levels[cells_job->level].tets;
    enum tetlod_status status =
        cell_choice_add(&cells_job->choice, dataset_file(cells_job->dataset), NULL, cells, error);
    if (status == TETLOD_OK)
        *out = (struct cache_value){cells,
                                    sizeof *cells + (size_t)cell_choice_bytes(&cells_job->choice, info,
                                                                              cells->tet_count), free_cells};
    else
        free_cells(cells);
    return status;
}

static void release(struct cache *cache, const struct held *held)
{
    cache_release(cache, held->cells);
    cache_release(cache, held->level_file);
    cache_release(cache, held->view);
    cache_release(cache, held->forest);
}

static void free_file(void *opaque)
{
    struct file *file = opaque;
    release(file->cache, &file->held);
    io_layout_free(file->layout);
    free(file);
}

static ptrdiff_t read_file(void *opaque, uint64_t begin, size_t size, unsigned char *out)
{
    struct file *file = opaque;
    io_layout_read(file->layout, &file->rows, begin, size, out);
    return file->held.level_file && level_file_failed(file->rows.opaque) ? -1 : (ptrdiff_t)size;
}

/* The view of a level as an entry that the caller releases. A view that is kept does not keep its forest: its key names
 * the one forest that it reads. */
static enum outcome obtain_view(struct exchange *exchange, const struct streamed_answer *answer,
                                const struct tetlod_info *info,
                                struct cache_entry *forest, struct cache_entry **out)
{
    struct site *site = exchange->site;
    struct view_job *view_job = array_new(1, sizeof *view_job);
    const struct cache_value *value;
    char key[120];
    *out = NULL;
    if (!view_job)
        return respond_no_memory(exchange);
    cache_hold(site->memory, forest);
    *view_job = (struct view_job){site, forest, answer->level};
    snprintf(key, sizeof key, "%s/view/%" PRIu64 "/%" PRIu32, info->cid, forest_serial(forest), answer->level);
    const uint64_t bytes = forest_view_bytes(forest_of(forest), answer->level);
    const uint64_t beside = forest_bytes(forest_of(forest));
    const struct job job = {make_view, free_view_job, view_job, bytes, MAX_WAIT_SECONDS, NULL, beside};
    enum outcome outcome = obtain(exchange, site->memory, key, &job, &value);
    if (value)
        *out = obtain_take(exchange->request, value);
    return outcome;
}

/* The chosen values of cells as an entry that the caller releases. */
static enum outcome obtain_cells(struct exchange *exchange, struct dataset *dataset,
                                 const struct streamed_answer *answer, struct cache_entry **out)
{
    const struct tetlod_info *info = dataset_info(dataset);
    struct cells_job *cells_job = array_new(1, sizeof *cells_job);
    const struct cache_value *value;
    char name[MAX_CELL_FIELDS / 4 + 1], key[sizeof name + 80];
    *out = NULL;
    if (!cells_job)
        return respond_no_memory(exchange);
    *cells_job = (struct cells_job){exchange->site, dataset_hold(dataset), answer->level, *answer->cells};
    cell_choice_name(answer->cells, name);
    snprintf(key, sizeof key, "%s/cells/%" PRIx64 "/%" PRIu32 "/%s", info->cid, dataset_file_number(dataset),
             answer->level, name);
    const struct job job = {make_cells, free_cells_job, cells_job,
                            cell_choice_decoding(answer->cells, info, answer->level) + 65536,
                                  MAX_WAIT_SECONDS, NULL, 0};
    enum outcome outcome = obtain(exchange, exchange->site->memory, key, &job, &value);
    if (value)
        *out = obtain_take(exchange->request, value);
    return outcome;
}

/* The level in a file as an entry that the caller releases. */
static enum outcome obtain_level_file(struct exchange *exchange, struct dataset *dataset, uint32_t level,
                                      struct cache_entry **out)
{
    struct file_job *file_job = array_new(1, sizeof *file_job);
    const struct cache_value *value;
    char key[120];
    *out = NULL;
    if (!file_job)
        return respond_no_memory(exchange);
    *file_job = (struct file_job){exchange->site, dataset_hold(dataset), level};
    snprintf(key, sizeof key, "%s/file/%" PRIx64 "/%" PRIu32, dataset_info(dataset)->cid, dataset_file_number(dataset),
             level);
    const struct job job = {make_level_file, free_file_job, file_job, 65536, MAX_WAIT_SECONDS,
                            exchange->site->decoders, 0};
    enum outcome outcome = obtain(exchange, exchange->site->memory, key, &job, &value);
    if (value)
        *out = obtain_take(exchange->request, value);
    return outcome;
}

/* Does the stream not fit into memory, and can the level do without? */
static bool goes_into_file(const struct site *site, const struct tetlod_info *info, uint32_t level)
{
    return level_file_is_for(info, level) && forest_estimate(info, level) > cache_capacity(site->memory);
}

/* All that the file is written from. False: *outcome says what came of it, and nothing is held. */
static bool obtain_all(struct exchange *exchange, struct dataset *dataset, const struct streamed_answer *answer,
                       struct held *out, enum outcome *outcome)
{
    *out = (struct held){NULL, NULL, NULL, NULL};
    if (goes_into_file(exchange->site, dataset_info(dataset), answer->level))
        *outcome = obtain_level_file(exchange, dataset, answer->level, &out->level_file);
    else
        *outcome = obtain_forest(exchange, dataset, answer->level, &out->forest);
    if (out->forest)
        *outcome = obtain_view(exchange, answer, dataset_info(dataset), out->forest, &out->view);
    const bool there = out->view || out->level_file;
    if (there && answer->cells->any)
        *outcome = obtain_cells(exchange, dataset, answer, &out->cells);
    if (there && (out->cells || !answer->cells->any))
        return true;
    release(exchange->site->memory, out);
    return false;
}

/* The file with its place for everything. The shape borrows the values of cells. */
static enum tetlod_status lay_out(struct file *file, const struct tetlod_info *info,
                                  const struct streamed_answer *answer, struct tetlod_error *error)
{
    struct tetmesh shape;
    TETLOD_TRY(tetmesh_shape(info, answer->level, &shape, error));
    enum tetlod_status status = level_mesh_units(info, &shape, error);
    if (status == TETLOD_OK && file->held.cells) {
        const struct tetmesh *cells = cache_value(file->held.cells, error)->data;
        shape.cell_fields = cells->cell_fields;
        shape.cell_field_count = cells->cell_field_count;
    }
    if (status == TETLOD_OK)
        status = answer->lay_out(&file->layout, &shape, error);
    shape.cell_fields = NULL;
    shape.cell_field_count = 0;
    tetmesh_fini(&shape);
    return status;
}

/* Takes over what is held, also on failure. */
static bool respond(struct exchange *exchange, const struct tetlod_info *info, const struct streamed_answer *answer,
                    const struct held *held)
{
    struct tetlod_error error = {0};
    struct file *file = array_zero(1, sizeof *file);
    struct cache *memory = exchange->site->memory;
    if (!file) {
        release(memory, held);
        respond_no_memory(exchange);
        return false;
    }
    *file = (struct file){.cache = memory, .held = *held};
    if (held->level_file)
        file->rows = (struct io_rows){cache_value(held->level_file, &error)->data, level_file_values,
                                      level_file_corners};
    else
        file->rows = (struct io_rows){cache_value(held->view, &error)->data, forest_view_values, forest_view_corners};
    if (lay_out(file, info, answer, &error) != TETLOD_OK) {
        free_file(file);
        respond_failure(exchange, &error);
        return false;
    }
    response_pieces(exchange->response, answer->media_type, io_layout_size(file->layout), read_file, free_file, file);
    return true;
}

enum outcome answer_streamed(struct exchange *exchange, struct dataset *dataset, const struct streamed_answer *answer)
{
    char name[MAX_CELL_FIELDS / 4 + 96];
    snprintf(name, sizeof name, "%s-%" PRIu32 "-%s-" TETLOD_VERSION_STRING, dataset_info(dataset)->cid, answer->level,
             answer->name);
    const struct representation representation = {.media_type = answer->media_type, .etag = name};
    if (!respond_unchanged(exchange, &representation, SIZE_UNKNOWN)) {
        struct held held;
        enum outcome outcome;
        if (!obtain_all(exchange, dataset, answer, &held, &outcome))
            return outcome;
        if (!respond(exchange, dataset_info(dataset), answer, &held))
            return ANSWERED;
        respond_representation(exchange->response, &representation);
        response_header_text(exchange->response, "Server-Timing", "cache;desc=none");
    }
    cache_forever(exchange);
    if (exchange->response->status == 200)
        level_headers(exchange->response, dataset, answer->level);
    return ANSWERED;
}
