/* SPDX-License-Identifier: BSD-3-Clause */
/* Headers of a request that say which form of an answer it wants: Range, If-None-Match, If-Range, Accept-Encoding. The
 * parsers are pure functions over NUL-terminated text of any content. */
#ifndef TETLOD_SERVER_CONDITIONS_H
#define TETLOD_SERVER_CONDITIONS_H

#include "server/http/coding.h"
#include "server/http/message.h"

enum range_result { RANGE_IGNORED, RANGE_OK, RANGE_UNSATISFIABLE };

/* Range header against a body of `size` bytes (RFC 9110, 14). One range only: several, other units and broken syntax
 * are ignored, as the RFC allows. */
enum range_result range_parse(const char *header, uint64_t size, uint64_t *out_first, uint64_t *out_length);

/* If-None-Match: a list of entity tags, compared weakly, or '*'. */
bool etag_list_has(const char *list, const char *etag);

/* If-Range: one strong entity tag. */
bool etag_same(const char *header, const char *etag);

/* The coding of the highest q that Accept-Encoding allows, of those in `have` (bits 1 << coding) and identity; among
 * equals br before zstd before gzip before identity. Without header (NULL) and where nothing is allowed: identity. */
enum coding coding_choose(const char *accept_encoding, unsigned have);

/* The range of a body of so many bytes, with this entity tag, that a request asks for (RFC 9110, 13.2.2). */
enum range_result request_range(const struct request *request, const char *etag, uint64_t size, uint64_t *first,
                                uint64_t *length);

/* If-None-Match and Range (RFC 9110, 13.2.2) on an answer of 200. */
void apply_conditions(const struct request *request, struct response *response);

#endif
