/* SPDX-License-Identifier: BSD-3-Clause */
/* Counters of what the server does, as Prometheus text. Counting takes no locks. */
#ifndef TETLOD_SERVER_METRICS_H
#define TETLOD_SERVER_METRICS_H

#include "src/util/buffer.h"

struct metrics;

/* `routes` are the templates to count by (NULL-terminated, borrowed); whatever is none of them counts as "other". */
struct metrics *metrics_new(const char *const *routes);
void metrics_free(struct metrics *metrics);

void metrics_request(struct metrics *metrics, const char *route, unsigned status, double seconds, uint64_t bytes);

enum metrics_counter { METRIC_LEVELS_MADE, METRIC_STREAMS_DECODED, METRIC_CONNECTIONS, METRIC_CONNECTIONS_REFUSED,
                       METRIC_CONNECTIONS_EXPIRED, METRIC_CONNECTIONS_LEFT, METRIC_ANSWERS_LOST, METRIC_WRONG_TOKENS,
                       METRIC_COUNTERS };

void metrics_count(struct metrics *metrics, enum metrics_counter counter);

/* A value that is read when it is asked for. */
struct metrics_gauge {
    const char *name, *type, *help; /* the name may have labels */
    double value;
};

TETLOD_CHECKED enum tetlod_status metrics_print(const struct metrics *metrics, const struct metrics_gauge *gauges,
                                                size_t gauge_count, struct buffer *out);

#endif
