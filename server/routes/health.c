/* SPDX-License-Identifier: BSD-3-Clause */
/* What those who run the server ask: health and metrics. */
#include <stdio.h>
#include <stdlib.h>

#include "server/http/respond.h"
#include "server/routes/handlers.h"
#include "src/util/buffer.h"

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
    char *text = malloc(160);
    int size = text ? snprintf(text, 160,
                               "{\"status\": \"ready\", \"meshes\": %zu, \"unreadable\": %zu, \"open_files\": %zu}\n",
                               catalogue_count(site->catalogue), catalogue_troubles(site->catalogue),
                               catalogue_open_files(site->catalogue))
                    : 0;
    if (!text)
        return respond_no_memory(exchange);
    response_owned(exchange->response, 200, "application/json", text, (size_t)size);
    response_header_text(exchange->response, "Cache-Control", "no-store");
    return ANSWERED;
}

/* What waits for a worker, and what workers are at: all pools together. */
static void count_jobs(const struct site *site, double *out_queued, double *out_working)
{
    struct workers *const pools[] = {site->workers, site->decoders, site->readers};
    *out_queued = *out_working = 0;
    for (size_t i = 0; i < sizeof pools / sizeof *pools; i++) {
        size_t queued = 0, working = 0;
        if (pools[i])
            workers_count(pools[i], &queued, &working);
        *out_queued += (double)queued;
        *out_working += (double)working;
    }
}

enum outcome handle_metrics(struct exchange *exchange)
{
    struct site *site = exchange->site;
    struct cache_stats cache, memory;
    struct buffer text = {0};
    double queued, working;
    cache_get_stats(site->cache, &cache);
    cache_get_stats(site->memory, &memory);
    count_jobs(site, &queued, &working);
    const struct metrics_gauge gauges[] = {
        {"tetlod_build_info{version=\"" TETLOD_VERSION_STRING "\"}", "gauge", "The program's version", 1},
        {"tetlod_connections", "gauge", "Connections that are open",
         site->connections ? (double)site->connections(site->connections_of) : 0},
        {"tetlod_queue_length", "gauge", "Jobs that wait for a worker thread", queued},
        {"tetlod_jobs", "gauge", "Jobs that worker threads are at", working},
        {"tetlod_unreadable_files", "gauge", "Files and folders that the last scan could not look at",
         (double)catalogue_troubles(site->catalogue)},
        {"tetlod_open_files", "gauge", "Streams whose files are open", (double)catalogue_open_files(site->catalogue)},
        {"tetlod_streams", "gauge", "Streams that are served", (double)catalogue_count(site->catalogue)},
        {"tetlod_stream_memory_bytes", "gauge", "Memory of decoded streams, and of answers too large for the cache",
         (double)memory.bytes},
        {"tetlod_stream_memory_entries", "gauge", "How many there are", (double)memory.entries},
        {"tetlod_cache_bytes", "gauge", "Memory of cached answers", (double)cache.bytes},
        {"tetlod_cache_entries", "gauge", "Cached answers", (double)cache.entries},
        {"tetlod_cache_hits_total", "counter", "Answers found in the cache", (double)cache.hits},
        {"tetlod_cache_misses_total", "counter", "Answers that had to be made", (double)cache.misses},
    };
    if (!site->serve_metrics)
        response_problem(exchange->response, 404, exchange->request->target,
                         "metrics have an address of their own here");
    else if (metrics_print(site->metrics, gauges, sizeof gauges / sizeof *gauges, &text) != TETLOD_OK) {
        buffer_fini(&text);
        respond_no_memory(exchange);
    } else {
        response_owned(exchange->response, 200, "text/plain; version=0.0.4; charset=utf-8", text.bytes, text.size);
        response_header_text(exchange->response, "Cache-Control", "no-store");
    }
    return ANSWERED;
}
