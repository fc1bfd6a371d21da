/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/jobs/made.h"

#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/encode.h"
#include "server/http/conditions.h"
#include "server/http/respond.h"
#include "server/jobs/obtain.h"
#include "src/stream/forest.h"
#include "src/stream/level_mesh.h"
#include "src/util/array.h"
#include "src/util/clock.h"

/* What work begins with that asks for memory as it goes on. */
enum { FIRST_BYTES = 1 << 16 };

/* One of them on its way to a worker. */
struct mesh_job {
    struct site *site;
    struct dataset *dataset; /* held */
    struct cache_entry *forest; /* held; NULL: it is not needed */
    struct level_answer answer; /* but for what it borrows */
    enum coding coding;
    _Alignas(max_align_t) unsigned char choice[]; /* a copy */
};

static void free_mesh_job(void *opaque)
{
    struct mesh_job *mesh_job = opaque;
    if (mesh_job->forest)
        cache_release(mesh_job->site->memory, mesh_job->forest);
    dataset_release(mesh_job->dataset);
    free(mesh_job);
}

/* Reserves what the file of a mesh takes, encoded as well if it will be. */
static enum tetlod_status reserve_file(const struct mesh_job *mesh_job, const struct tetmesh *mesh, struct room *room,
                                       struct buffer *out, struct tetlod_error *error)
{
    uint64_t size = 0;
    if (!mesh_job->answer.measure)
        return TETLOD_OK;
    TETLOD_TRY(mesh_job->answer.measure(mesh_job->choice, mesh, &size, error));
    TETLOD_TRY(room_take(room, size + buffer_encoding_bytes(size, mesh_job->coding), error));
    return buffer_reserve(out, size, error);
}

/* Makes the mesh and writes it; says when the mesh was there. Between the steps it gives up if nobody waits any
 * more. */
static enum tetlod_status write_answer(const struct mesh_job *mesh_job, struct run *run, struct buffer *out,
                                       struct region_note *note, double *extracted, struct tetlod_error *error)
{
    const struct level_answer *answer = &mesh_job->answer;
    const struct forest *forest = mesh_job->forest ? forest_of(mesh_job->forest) : NULL;
    struct tetmesh mesh;
    TETLOD_TRY(answer->mesh ? answer->mesh(mesh_job->choice, forest, run_room(run), &mesh, note, error)
                            : forest_mesh(forest, answer->level, &mesh, error));
    *extracted = monotonic_seconds();
    enum tetlod_status status = level_mesh_units(dataset_info(mesh_job->dataset), &mesh, error);
    if (status == TETLOD_OK && !run_wanted(run))
        status = fail_unwanted(error);
    if (status == TETLOD_OK)
        status = reserve_file(mesh_job, &mesh, run_room(run), out, error);
    if (status == TETLOD_OK)
        status = answer->write(mesh_job->choice, &mesh, out, error);
    tetmesh_fini(&mesh);
    return status;
}

static enum tetlod_status make(void *opaque, struct run *run, struct cache_value *out, struct tetlod_error *error)
{
    struct mesh_job *mesh_job = opaque;
    struct region_note note = {0};
    struct buffer buffer = {0};
    double started = monotonic_seconds(), extracted = started;
    enum tetlod_status status = write_answer(mesh_job, run, &buffer, &note, &extracted, error);
    if (status == TETLOD_OK && !run_wanted(run))
        status = fail_unwanted(error);
    if (status == TETLOD_OK)
        status = buffer_encode(&buffer, mesh_job->coding, error);
    if (status == TETLOD_OK)
        status = body_take(&buffer, started, extracted, out, error);
    if (status == TETLOD_OK)
        ((struct body *)out->data)->note = note;
    buffer_fini(&buffer);
    metrics_count(mesh_job->site->metrics, METRIC_LEVELS_MADE);
    return status;
}

/* Memory that making takes at most: the level as arrays, with a number for each slot of the stream, and its file, which
 * grows by half at a time and may be there encoded as well. */
static uint64_t making_bytes(const struct tetlod_info *info, const struct level_answer *answer)
{
    uint64_t components = 3;
    if (answer->alone)
        return answer->file_bytes * 5 / 2 + answer->mesh_bytes + 65536;
    for (uint32_t f = 0; f < info->field_count; f++)
        components += info->fields[f].components;
    return info->levels[answer->level].vertices * components * 8 + info->levels[answer->level].tets * (uint64_t)16 +
           info->vertices * (uint64_t)4 + answer->file_bytes * 5 / 2 + answer->mesh_bytes + 65536;
}

bool fits_cache(const struct site *site, const struct tetlod_info *info, const struct level_answer *answer)
{
    return cache_for(site, making_bytes(info, answer)) == site->cache;
}

/* The value is NULL if it is not there yet, or the response says why it will not be. */
static enum outcome obtain_answer(struct exchange *exchange, struct dataset *dataset, const struct level_answer *answer,
                                  enum coding coding, struct cache *cache, const char *key,
                                  const struct cache_value **out)
{
    struct cache_entry *forest = NULL;
    uint32_t level = answer->finest ? dataset_info(dataset)->level_count - 1 : answer->level;
    *out = NULL;
    if (answer->alone && dataset_hangs(dataset))
        return respond_hanging(exchange, dataset);
    enum outcome outcome = answer->alone ? ANSWERED : obtain_forest(exchange, dataset, level, &forest);
    if (!forest && !answer->alone)
        return outcome;
    struct mesh_job *mesh_job = malloc(sizeof *mesh_job + answer->choice_size);
    if (!mesh_job) {
        if (forest)
            cache_release(exchange->site->memory, forest);
        return respond_no_memory(exchange);
    }
    *mesh_job = (struct mesh_job){exchange->site, dataset_hold(dataset), forest, *answer, coding};
    memcpy(mesh_job->choice, answer->choice, answer->choice_size);
    uint64_t bytes = answer->measure ? FIRST_BYTES : making_bytes(dataset_info(dataset), answer);
    const struct job job = {make, free_mesh_job, mesh_job, bytes, MAX_WAIT_SECONDS, NULL,
                            forest && cache == exchange->site->memory ? forest_bytes(forest_of(forest)) : 0};
    return obtain(exchange, cache, key, &job, out);
}

enum outcome answer_from_level(struct exchange *exchange, struct dataset *dataset, const struct level_answer *answer)
{
    struct response *response = exchange->response;
    enum outcome outcome = ANSWERED;
    char name[ETAG_CAPACITY - 8], key[ETAG_CAPACITY + 24];
    struct representation representation = {
        .media_type = answer->media_type,
        .coding = coding_choose(request_header(exchange->request, "Accept-Encoding"), CODINGS_MADE),
        .etag = name,
    };
    snprintf(name, sizeof name, "%s-%" PRIu32 "-%s-" TETLOD_VERSION_STRING, dataset_info(dataset)->cid, answer->level,
             answer->name);
    snprintf(key, sizeof key, "%s/%" PRIx64 "/%s", name, dataset_file_number(dataset),
             coding_name(representation.coding));
    struct cache *cache = cache_for(exchange->site, making_bytes(dataset_info(dataset), answer));
    const struct cache_value *value = obtain_cached(exchange, cache, key);
    if (!value && respond_unchanged(exchange, &representation, SIZE_UNKNOWN))
        cache_forever(exchange);
    else if (!value)
        outcome = obtain_answer(exchange, dataset, answer, representation.coding, cache, key, &value);
    if (value) {
        respond_body(exchange, value, &representation);
        cache_forever(exchange);
    }
    if (outcome == ANSWERED && response->status == 200 && answer->headers)
        answer->headers(response, dataset, answer->choice, value ? &((const struct body *)value->data)->note : NULL);
    else if (outcome == ANSWERED && response->status == 200)
        level_headers(response, dataset, answer->level);
    return outcome;
}
