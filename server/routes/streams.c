/* SPDX-License-Identifier: BSD-3-Clause */
/* The catalogue and the description of a stream, as JSON. */
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/http/conditions.h"
#include "server/http/params.h"
#include "server/http/respond.h"
#include "server/jobs/json_body.h"
#include "server/jobs/obtain.h"
#include "server/routes/handlers.h"
#include "server/routes/stream_json.h"
#include "src/util/array.h"

struct info_context {
    struct dataset *dataset;
    enum coding coding;
};

static void free_info_context(void *opaque)
{
    struct info_context *context = opaque;
    dataset_release(context->dataset);
    free(context);
}

static enum tetlod_status make_info(void *opaque, struct run *run, struct cache_value *out, struct tetlod_error *error)
{
    struct info_context *context = opaque;
    (void)run;
    return json_body(describe_stream(context->dataset, dataset_id(context->dataset)), context->coding, out, error);
}

/* The topology group that the query names, of a stream that is held; without a name the stream itself. NULL: answered,
 * and the stream is released. */
static struct dataset *take_topology(struct exchange *exchange, struct dataset *whole)
{
    uint32_t count = dataset_info(whole)->topology_count, topology = 0;
    char text[24];
    enum query_result result = query_value(exchange->query, "topology", text, sizeof text);
    if (check_parameters(exchange) &&
        (result == QUERY_ABSENT ||
         take_number(exchange, result == QUERY_FOUND ? text : "", "topology group", count ? count : 1, &topology)))
        return dataset_topology(whole, topology);
    dataset_release(whole);
    return NULL;
}

enum outcome handle_stream_info(struct exchange *exchange)
{
    struct dataset *dataset = take_topology(exchange, dataset_hold(exchange->dataset));
    if (!dataset)
        return ANSWERED;
    enum coding coding = coding_choose(request_header(exchange->request, "Accept-Encoding"), CODINGS_MADE);
    struct info_context *context = array_new(1, sizeof *context);
    if (!context) {
        dataset_release(dataset);
        return respond_no_memory(exchange);
    }
    *context = (struct info_context){dataset, coding};
    char key[256], etag[64];
    snprintf(etag, sizeof etag, "%s-" TETLOD_VERSION_STRING,
             dataset_info(dataset)->cid); // what it says may differ from version to version
    snprintf(key, sizeof key, "%s/info/%s/%s", dataset_info(dataset)->cid, coding_name(coding), dataset_id(dataset));
    const struct job job = {make_info, free_info_context, context,
                            1024 * (uint64_t)(1 + dataset_info(dataset)->level_count), MAX_WAIT_SECONDS, NULL, 0};
    return answer_json(exchange, exchange->site->cache, key, etag, coding, &job);
}

/* Which part of the catalogue: `limit` streams at most, those behind the id `after`. */
struct page {
    uint32_t limit;
    char after[ID_CAPACITY];
};

/* The streams at one moment; all held. */
struct list_context {
    struct dataset **list;
    size_t count;
    struct page page;
    enum coding coding;
};

static void free_list_context(void *opaque)
{
    struct list_context *context = opaque;
    for (size_t i = 0; i < context->count; i++)
        dataset_release(context->list[i]);
    free(context->list);
    free(context);
}

enum { MAX_PAGE = 10001 }; // that one page may have, and one more

/* Where the page behind this one is, relative as the links of the streams. */
static json_t *next_page(const char *last, uint32_t limit)
{
    char id[3 * ID_CAPACITY], path[3 * ID_CAPACITY + 48];
    if (!percent_encode(last, id, sizeof id))
        return NULL;
    snprintf(path, sizeof path, "meshes?limit=%" PRIu32 "&after=%s", limit, id);
    return json_string(path);
}

static enum tetlod_status make_list(void *opaque, struct run *run, struct cache_value *out, struct tetlod_error *error)
{
    const struct list_context *context = opaque;
    const struct page *page = &context->page;
    json_t *meshes = json_array();
    (void)run;
    size_t from = 0;
    while (from < context->count && page->after[0] && strcmp(dataset_id(context->list[from]), page->after) <= 0)
        from++;
    size_t end = context->count - from > page->limit ? from + page->limit : context->count;
    for (size_t i = from; i < end; i++)
        json_array_append_new(meshes,
                              describe_in_catalogue(dataset_info(context->list[i]), dataset_id(context->list[i])));
    json_t *list = json_pack("{s:I, s:o}", "count", (json_int_t)context->count, "meshes", meshes);
    if (list && end < context->count)
        json_object_set_new(list, "next", next_page(dataset_id(context->list[end - 1]), page->limit));
    return json_body(list, context->coding, out, error);
}

enum { LIST_TAG = 64, LIST_KEY = 128 + ID_CAPACITY };

static void name_list(uint64_t digest, enum coding coding, const struct page *page, char etag[static LIST_TAG],
                      char key[static LIST_KEY])
{
    snprintf(etag, LIST_TAG, "%016llx-" TETLOD_VERSION_STRING, (unsigned long long)digest);
    snprintf(key, LIST_KEY, "catalogue/%s/%s/%" PRIu32 "/%s", etag, coding_name(coding), page->limit, page->after);
}

/* False after a 400. */
static bool take_page(struct exchange *exchange, struct page *out)
{
    char text[16];
    out->limit = UINT32_MAX;
    out->after[0] = 0;
    enum query_result limit = query_value(exchange->query, "limit", text, sizeof text);
    if (limit != QUERY_ABSENT &&
        (!take_number(exchange, limit == QUERY_FOUND ? text : "", "limit", MAX_PAGE, &out->limit)))
        return false;
    out->limit += limit == QUERY_FOUND && !out->limit; // a page has one stream at least
    if (query_value(exchange->query, "after", out->after, sizeof out->after) != QUERY_BAD)
        return true;
    response_problem(exchange->response, 400, exchange->request->target, "'after' is the id of a stream");
    return false;
}

/* Makes the list, under the name of just the streams that are in it. */
static enum outcome obtain_list(struct exchange *exchange, enum coding coding, const struct page *page,
                                char etag[static LIST_TAG], const struct cache_value **out)
{
    struct site *site = exchange->site;
    struct list_context *context = array_zero(1, sizeof *context);
    char key[LIST_KEY];
    uint64_t digest;
    *out = NULL;
    if (!context || !(context->list = catalogue_list(site->catalogue, SIZE_MAX, &context->count, &digest))) {
        free(context);
        return respond_no_memory(exchange);
    }
    context->coding = coding;
    context->page = *page;
    name_list(digest, coding, page, etag, key);
    const struct job job = {make_list, free_list_context, context, 4096 * (uint64_t)(1 + context->count),
                            MAX_WAIT_SECONDS, NULL, 0};
    return obtain(exchange, cache_for(site, job.bytes), key, &job, out);
}

/* Made once for each state of the catalogue, however many streams it has. */
enum outcome handle_catalogue(struct exchange *exchange)
{
    struct site *site = exchange->site;
    enum coding coding = coding_choose(request_header(exchange->request, "Accept-Encoding"), CODINGS_MADE);
    enum outcome outcome = ANSWERED;
    struct page page;
    if (!check_parameters(exchange) || !take_page(exchange, &page))
        return ANSWERED;
    char etag[LIST_TAG], key[LIST_KEY];
    name_list(catalogue_digest(site->catalogue), coding, &page, etag, key);
    const struct cache_value *value =
        obtain_cached(exchange, cache_for(site, 4096 * (uint64_t)(1 + catalogue_count(site->catalogue))), key);
    if (!value)
        outcome = obtain_list(exchange, coding, &page, etag, &value);
    if (value) {
        respond_json(exchange, value, etag, coding);
        link_description(exchange);
    }
    return outcome;
}
