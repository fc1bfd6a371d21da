/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Stored bytes of a stream as answers: the whole file, prefixes, records, ranges of them. Threads of connections never
 * read a file: a worker reads a window of the answer, held against the stream's digests, into the cache, and what is
 * sent comes from there. So a file that is damaged, is being written or hangs costs nobody anything but those who ask
 * for it.
 */
#ifndef TETLOD_SERVER_STORED_H
#define TETLOD_SERVER_STORED_H

#include "server/http/exchange.h"

/* Spans of the stream in a row, under an entity tag without quotes. */
enum outcome respond_stored(struct exchange *exchange, struct dataset *dataset, const struct tetlod_span *spans,
                            size_t count, const char *etag);

#endif
