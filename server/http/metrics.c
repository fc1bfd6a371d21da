/* SPDX-License-Identifier: BSD-3-Clause */
/* Prometheus text format 0.0.4. */
#include "server/http/metrics.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* Upper bounds of the latency histogram, seconds. */
static const double bounds[] = {0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10};

enum { BUCKETS = sizeof bounds / sizeof *bounds };

static const unsigned statuses[] = {200, 204, 206, 303, 304, 308, 400, 401, 404, 405, 413, 414, 416, 421, 422, 429,
                                    431, 500, 503, 505};

enum { STATUSES = sizeof statuses / sizeof *statuses };

static const struct {
    const char *name, *help;
} counters[METRIC_COUNTERS] = {
    [METRIC_LEVELS_MADE] = {"tetlod_levels_made_total", "Level meshes, surfaces and slices computed"},
    [METRIC_STREAMS_DECODED] = {"tetlod_streams_decoded_total", "Streams decoded into memory"},
    [METRIC_CONNECTIONS] = {"tetlod_connections_total", "Connections accepted"},
    [METRIC_CONNECTIONS_REFUSED] = {"tetlod_connections_refused_total", "Connections refused by a limit"},
    [METRIC_CONNECTIONS_EXPIRED] = {"tetlod_connections_expired_total", "Connections closed because no request came"},
    [METRIC_CONNECTIONS_LEFT] = {"tetlod_connections_left_total",
                                 "Connections closed by clients that waited for an answer"},
    [METRIC_ANSWERS_LOST] = {"tetlod_answers_lost_total",
                             "Connections that waited or were closed, and answers not made or cut short, for want of "
                             "memory, descriptors or a file's bytes"},
    [METRIC_WRONG_TOKENS] = {"tetlod_wrong_tokens_total", "Requests with a wrong token"},
};

struct route_metrics {
    atomic_ullong requests[STATUSES + 1]; /* the last: any other status */
    atomic_ullong latency[BUCKETS + 1];
    atomic_ullong microseconds, bytes;
};

struct metrics {
    const char *const *routes;
    size_t route_count; /* without "other", which is the last of `by_route` */
    struct route_metrics *by_route;
    atomic_ullong counters[METRIC_COUNTERS];
};

struct metrics *metrics_new(const char *const *routes)
{
    struct metrics *metrics = array_zero(1, sizeof *metrics);
    if (!metrics)
        return NULL;
    metrics->routes = routes;
    while (routes[metrics->route_count])
        metrics->route_count++;
    metrics->by_route = array_zero(metrics->route_count + 1, sizeof *metrics->by_route);
    if (!metrics->by_route) {
        free(metrics);
        return NULL;
    }
    return metrics;
}

void metrics_free(struct metrics *metrics)
{
    if (metrics)
        free(metrics->by_route);
    free(metrics);
}

static void add(atomic_ullong *counter, unsigned long long value)
{
    atomic_fetch_add_explicit(counter, value, memory_order_relaxed);
}

static unsigned long long get(const atomic_ullong *counter)
{
    return atomic_load_explicit(counter, memory_order_relaxed);
}

void metrics_request(struct metrics *metrics, const char *route, unsigned status, double seconds, uint64_t bytes)
{
    size_t r = 0, s = 0, b = 0;
    while (r < metrics->route_count && (!route || strcmp(metrics->routes[r], route) != 0))
        r++;
    while (s < STATUSES && statuses[s] != status)
        s++;
    while (b < BUCKETS && seconds > bounds[b])
        b++;
    struct route_metrics *m = &metrics->by_route[r];
    add(&m->requests[s], 1);
    add(&m->latency[b], 1);
    add(&m->microseconds, (unsigned long long)(seconds * 1e6));
    add(&m->bytes, bytes);
}

void metrics_count(struct metrics *metrics, enum metrics_counter counter)
{
    add(&metrics->counters[counter], 1);
}

static enum tetlod_status print_requests(const struct metrics *metrics, struct buffer *out)
{
    TETLOD_TRY(buffer_printf(out,
                             "# HELP tetlod_requests_total Requests answered\n# TYPE tetlod_requests_total counter\n"));
    for (size_t r = 0; r <= metrics->route_count; r++)
        for (size_t s = 0; s <= STATUSES; s++) {
            unsigned long long count = get(&metrics->by_route[r].requests[s]);
            const char *route = r < metrics->route_count ? metrics->routes[r] : "other";
            if (count && s < STATUSES)
                TETLOD_TRY(buffer_printf(out, "tetlod_requests_total{route=\"%s\",status=\"%u\"} %llu\n", route,
                                         statuses[s], count));
            else if (count)
                TETLOD_TRY(buffer_printf(out, "tetlod_requests_total{route=\"%s\",status=\"other\"} %llu\n", route,
                                         count));
        }
    return TETLOD_OK;
}

static enum tetlod_status print_latency(const char *route, const struct route_metrics *m, struct buffer *out)
{
    unsigned long long below = 0;
    for (size_t b = 0; b < BUCKETS; b++) {
        below += get(&m->latency[b]);
        TETLOD_TRY(buffer_printf(out, "tetlod_request_seconds_bucket{route=\"%s\",le=\"%g\"} %llu\n", route, bounds[b],
                                 below));
    }
    below += get(&m->latency[BUCKETS]);
    if (!below)
        return TETLOD_OK;
    TETLOD_TRY(buffer_printf(out, "tetlod_request_seconds_bucket{route=\"%s\",le=\"+Inf\"} %llu\n", route, below));
    TETLOD_TRY(buffer_printf(out, "tetlod_request_seconds_sum{route=\"%s\"} %.6f\n", route,
                             (double)get(&m->microseconds) / 1e6));
    return buffer_printf(out, "tetlod_request_seconds_count{route=\"%s\"} %llu\n", route, below);
}

static bool asked(const struct route_metrics *m)
{
    for (size_t s = 0; s <= STATUSES; s++)
        if (get(&m->requests[s]))
            return true;
    return false;
}

enum tetlod_status metrics_print(const struct metrics *metrics, const struct metrics_gauge *gauges, size_t gauge_count,
                                 struct buffer *out)
{
    TETLOD_TRY(print_requests(metrics, out));
    TETLOD_TRY(buffer_printf(out, "# HELP tetlod_request_seconds Time from the request line to the end of the answer\n"
                                  "# TYPE tetlod_request_seconds histogram\n"));
    for (size_t r = 0; r <= metrics->route_count; r++)
        if (asked(&metrics->by_route[r]))
            TETLOD_TRY(print_latency(r < metrics->route_count ? metrics->routes[r] : "other", &metrics->by_route[r],
                                     out));
    TETLOD_TRY(buffer_printf(out, "# HELP tetlod_sent_bytes_total Bytes of bodies sent\n"
                                  "# TYPE tetlod_sent_bytes_total counter\n"));
    for (size_t r = 0; r <= metrics->route_count; r++)
        if (asked(&metrics->by_route[r]))
            TETLOD_TRY(buffer_printf(out, "tetlod_sent_bytes_total{route=\"%s\"} %llu\n",
                                     r < metrics->route_count ? metrics->routes[r] : "other",
                                     get(&metrics->by_route[r].bytes)));
    for (size_t c = 0; c < METRIC_COUNTERS; c++)
        TETLOD_TRY(buffer_printf(out, "# HELP %s %s\n# TYPE %s counter\n%s %llu\n", counters[c].name, counters[c].help,
                                 counters[c].name, counters[c].name, get(&metrics->counters[c])));
    for (size_t g = 0; g < gauge_count; g++) {
        int bare = (int)strcspn(gauges[g].name, "{");
        TETLOD_TRY(buffer_printf(out, "# HELP %.*s %s\n# TYPE %.*s %s\n%s %.15g\n", bare, gauges[g].name,
                                 gauges[g].help, bare,
                                 gauges[g].name, gauges[g].type, gauges[g].name, gauges[g].value));
    }
    return TETLOD_OK;
}
