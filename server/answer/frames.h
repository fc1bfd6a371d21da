/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Stored bytes of a stream: the whole file, prefixes, records, chosen fields' frames. libmicrohttpd sends what is in memory with
 * the header in one call, and what is read in pieces after it: up to a few megabytes memory is faster
 * (tests/bench/server.py), so that records and prefixes go through the cache; what is larger, ranges, and what finds no room
 * there go from the file. After each piece the file's times are looked at: who reads a file that is being written over gets an
 * answer that ends too early, never a mixture.
 */
#ifndef TETLOD_SERVER_FRAMES_H
#define TETLOD_SERVER_FRAMES_H

#include "server/answer/exchange.h"

/* The stream's bytes up to a level. */
enum outcome respond_level_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level);

/* The same; of the fields' frames only those that the query's `fields` names, if it is there. */
enum outcome respond_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level);

/* Pieces of the stream in a row, under an entity tag without quotes. */
enum outcome respond_stored(struct exchange *exchange, struct dataset *dataset, const struct tetlod_span *spans, size_t count, const char *etag);

/* The list of names that the query's `fields` has: text of 0 and 1, one for each field. QUERY_BAD: answered. */
enum query_result query_fields(struct exchange *exchange, const struct tetlod_info *info, char *selected);

enum outcome handle_records(struct exchange *exchange);
enum outcome handle_stream(struct exchange *exchange);

#endif
