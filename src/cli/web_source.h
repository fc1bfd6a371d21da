/* SPDX-License-Identifier: BSD-3-Clause */
/* The bytes of a stream on a web host, by Range requests (libcurl). Only the parts that are read are fetched. */
#ifndef TETLOD_WEB_SOURCE_H
#define TETLOD_WEB_SOURCE_H

#include "format/tetlod.h"

#include <stdbool.h>

struct web_source;

/* Does the text begin as a URL does that can be read? */
bool web_source_is(const char *text);

/* A stream on any host, or that of a tetlod server by the address of its mesh or of the page that shows it.
 * `out_source` borrows from *out, which is to be freed after the file; it is for one thread at a time. ERR_IO,
 * ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status web_source_open(struct web_source **out, const char *url,
                                                  struct tetlod_source *out_source, struct tetlod_error *error);
/* Fetches parts that will be read, in requests at the same time. ERR_IO, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status web_source_fetch(struct web_source *source, const struct tetlod_span *spans,
                                                   size_t count, struct tetlod_error *error);
void web_source_free(struct web_source *source);

/* What the last request failed with, "" if none did: a source can only say that it did. */
const char *web_source_problem(const struct web_source *source);

#endif
