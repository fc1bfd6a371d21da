/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/site.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "server/answer/obtain.h"
#include "server/answer/respond.h"
#include "server/answer/stream_json.h"
#include "src/report/info_json.h"
#include "src/util/array.h"
#include "src/util/clock.h"

/* Nothing from elsewhere runs here or is asked, but streams of the origins that the operator named. The page's workers and
 * its WebAssembly need what is said of them; blob: is for pictures and workers that it makes itself. */
static void content_policy(const struct site *site, struct response *response)
{
    response_header(response, "Content-Security-Policy",
                    "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; img-src 'self' data: blob:; "
                    "object-src 'none'; base-uri 'none'; form-action 'none'; connect-src 'self'%s",
                    site->stream_origins ? site->stream_origins : "");
}

enum outcome handle_asset(struct exchange *exchange, const struct embedded_file *asset)
{
    struct response *response = exchange->response;
    enum coding coding = coding_choose(request_header(exchange->request, "Accept-Encoding"));
    if (!asset->coded[coding].bytes)
        coding = CODING_IDENTITY;
    const struct embedded_bytes *coded = &asset->coded[coding];
    response->status = 200;
    response->media_type = asset->media_type;
    response->kind = BODY_BYTES;
    response->bytes = coded->bytes;
    response->size = (size_t)(coded->end - coded->bytes);
    if (coding)
        response_header_text(response, "Content-Encoding", coding_name(coding));
    snprintf(response->etag, sizeof response->etag, "\"%s%s%s\"", asset->hash, coding ? "-" : "", coding_name(coding));
    response_header_text(response, "Vary", "Accept-Encoding");
    content_policy(exchange->site, response);
    response_header_text(response, "X-Content-Type-Options", "nosniff");
    link_description(exchange);
    if (asset->named_by_content)
        cache_forever(exchange);
    else
        cache_revalidate(response);
    return ANSWERED;
}

/* Which stream the page shows, and how, it reads from its own address. */
enum outcome handle_view(struct exchange *exchange)
{
    const struct embedded_file *page = assets_find("/view/");
    if (page)
        return handle_asset(exchange, page);
    response_problem(exchange->response, 404, exchange->request->target, "this program was built without the page (WEB=0)");
    return ANSWERED;
}

enum outcome handle_health(struct exchange *exchange)
{
    response_static(exchange->response, 200, "application/json", "{\"status\": \"alive\"}\n");
    response_header_text(exchange->response, "Cache-Control", "no-store");
    return ANSWERED;
}

enum outcome handle_ready(struct exchange *exchange)
{
    struct site *site = exchange->site;
    if (atomic_load(&site->draining)) {
        response_problem(exchange->response, 503, exchange->request->target, "the server is about to stop");
        return ANSWERED;
    }
    char *text = malloc(120);
    int size = text ? snprintf(text, 120, "{\"status\": \"ready\", \"meshes\": %zu, \"unreadable\": %zu}\n", catalogue_count(site->catalogue),
                               catalogue_troubles(site->catalogue))
                    : 0;
    if (!text) {
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    response_owned(exchange->response, 200, "application/json", text, (size_t)size);
    response_header_text(exchange->response, "Cache-Control", "no-store");
    return ANSWERED;
}

enum outcome handle_metrics(struct exchange *exchange)
{
    struct site *site = exchange->site;
    struct cache_stats cache;
    struct buffer text = {0};
    cache_get_stats(site->cache, &cache);
    const struct metrics_gauge gauges[] = {
        {"tetlod_streams", "gauge", "Streams that are served", (double)catalogue_count(site->catalogue)},
        {"tetlod_stream_memory_bytes", "gauge", "Memory of decoded streams", (double)catalogue_memory(site->catalogue)},
        {"tetlod_cache_bytes", "gauge", "Memory of cached answers", (double)cache.bytes},
        {"tetlod_cache_entries", "gauge", "Cached answers", (double)cache.entries},
        {"tetlod_cache_hits_total", "counter", "Answers found in the cache", (double)cache.hits},
        {"tetlod_cache_misses_total", "counter", "Answers that had to be made", (double)cache.misses},
    };
    if (!site->serve_metrics)
        response_problem(exchange->response, 404, exchange->request->target, "metrics have an address of their own here");
    else if (metrics_print(site->metrics, gauges, sizeof gauges / sizeof *gauges, &text) != TETLOD_OK) {
        buffer_fini(&text);
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
    } else {
        response_owned(exchange->response, 200, "text/plain; version=0.0.4; charset=utf-8", text.bytes, text.size);
        response_header_text(exchange->response, "Cache-Control", "no-store");
    }
    return ANSWERED;
}

/* ---- JSON ---- */

/* Makes a cached JSON answer: prints, encodes. Takes over the object. */
static enum tetlod_status json_body(json_t *object, enum coding coding, struct cache_value *out, struct tetlod_error *error)
{
    struct buffer buffer = {0};
    double started = monotonic_seconds();
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS | JSON_INDENT(1)) : NULL;
    enum tetlod_status status = TETLOD_OK;
    json_decref(object);
    if (!text || buffer_append(&buffer, text, strlen(text)) != TETLOD_OK || buffer_append(&buffer, "\n", 1) != TETLOD_OK)
        status = tetlodi_fail_nomem(error, "an answer", 0);
    free(text);
    if (status == TETLOD_OK)
        status = buffer_encode(&buffer, coding, error);
    if (status == TETLOD_OK)
        status = body_take(&buffer, started, started, out, error);
    buffer_fini(&buffer);
    return status;
}

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

static enum tetlod_status make_info(void *opaque, struct cache_value *out, struct tetlod_error *error)
{
    struct info_context *context = opaque;
    const struct tetlod_info *info = dataset_info(context->dataset);
    return json_body(describe_stream(info, dataset_id(context->dataset)), context->coding, out, error);
}

enum outcome handle_stream_info(struct exchange *exchange)
{
    struct dataset *dataset = catalogue_find(exchange->site->catalogue, exchange->captures[0]);
    if (!dataset) {
        respond_no_mesh(exchange);
        return ANSWERED;
    }
    enum coding coding = coding_choose(request_header(exchange->request, "Accept-Encoding"));
    struct info_context *context = array_new(1, sizeof *context);
    if (!context) {
        dataset_release(dataset);
        response_problem(exchange->response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    *context = (struct info_context){dataset, coding};
    char key[256], etag[64];
    snprintf(etag, sizeof etag, "%s-" TETLOD_VERSION_STRING, dataset_info(dataset)->cid); // what it says may differ from version to version
    snprintf(key, sizeof key, "%s/info/%s/%s", dataset_info(dataset)->cid, coding_name(coding), dataset_id(dataset));
    const struct cache_value *value;
    const struct recipe recipe = {make_info, free_info_context, context,
                                  1024 * (uint64_t)(1 + dataset_info(dataset)->level_count), PATIENCE};
    enum outcome outcome = obtain(exchange, exchange->site->cache, key, &recipe, &value);
    if (value) {
        respond_body(exchange, value, &(struct representation){.media_type = "application/json", .coding = coding, .etag = etag});
        cache_revalidate(exchange->response);
    }
    return outcome;
}

enum outcome handle_catalogue(struct exchange *exchange)
{
    struct response *response = exchange->response;
    enum coding coding = coding_choose(request_header(exchange->request, "Accept-Encoding"));
    size_t count = 0;
    struct dataset **list = catalogue_list(exchange->site->catalogue, &count);
    json_t *meshes = json_array();
    for (size_t i = 0; list && i < count; i++) {
        json_array_append_new(meshes, describe_in_catalogue(dataset_info(list[i]), dataset_id(list[i])));
        dataset_release(list[i]);
    }
    free(list);
    json_t *object = json_pack("{s:o}", "meshes", meshes);
    char *text = object ? json_dumps(object, INFO_JSON_FLAGS | JSON_INDENT(1)) : NULL;
    uint64_t hash = 0xcbf29ce484222325u; // FNV-1a
    for (const char *c = text; c && *c; c++)
        hash = (hash ^ (unsigned char)*c) * 0x100000001b3u;
    struct buffer buffer = {0};
    bool made = list && text && buffer_append(&buffer, text, strlen(text)) == TETLOD_OK &&
                buffer_encode(&buffer, coding, NULL) == TETLOD_OK;
    json_decref(object);
    free(text);
    if (!made) {
        buffer_fini(&buffer);
        response_problem(response, 503, exchange->request->target, "the server is out of memory");
        return ANSWERED;
    }
    response_owned(response, 200, "application/json", buffer.bytes, buffer.size);
    if (coding)
        response_header_text(response, "Content-Encoding", coding_name(coding));
    snprintf(response->etag, sizeof response->etag, "\"%016llx%s%s\"", (unsigned long long)hash, coding ? "-" : "",
             coding_name(coding));
    response_header_text(response, "Vary", "Accept-Encoding");
    link_description(exchange);
    cache_revalidate(response);
    return ANSWERED;
}
