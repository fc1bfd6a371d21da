/* SPDX-License-Identifier: BSD-3-Clause */
/* Which stored bytes of a stream an address means: the whole file, prefixes, records, chosen fields' frames. */
#ifndef TETLOD_SERVER_FRAMES_H
#define TETLOD_SERVER_FRAMES_H

#include "server/http/exchange.h"
#include "server/http/params.h"

/* The stream's bytes up to a level. */
enum outcome respond_level_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level);

/* The same; of the fields' frames only those that the query's `fields` names, if it is there. */
enum outcome respond_prefix(struct exchange *exchange, struct dataset *dataset, uint32_t level);

/* The list of names that the query's `fields` has: text of 0 and 1, one for each field. QUERY_BAD: answered. */
enum query_result query_fields(struct exchange *exchange, const struct tetlod_info *info, char *selected);

#endif
