/* SPDX-License-Identifier: BSD-3-Clause */
/* Parts of answers that several handlers share: representations, problems, headers of levels. */
#ifndef TETLOD_SERVER_RESPOND_H
#define TETLOD_SERVER_RESPOND_H

#include <jansson.h>

#include "server/http/encode.h"
#include "server/http/exchange.h"

/* What a region's headers say of it. */
struct region_note {
    uint32_t vertices, tets, transition_tets;
    double transition_error; /* the largest of the controlled fields, a fraction of the range */
    bool certified;          /* a bound of it; else it is the true one, measured */
};

/* The value of a cached answer. */
struct body {
    size_t size;
    char timing[64]; /* how long it took: the level alone, and all */
    unsigned char *bytes;
    struct region_note note; /* of a region */
};

/* Turns a buffer, which it empties, into a cache value that was made from `started` until now, its level until
 * `extracted`. */
TETLOD_CHECKED enum tetlod_status body_take(struct buffer *buffer, double started, double extracted,
                                            struct cache_value *out,
                                            struct tetlod_error *error);

/* What headers say of a body. */
struct representation {
    const char *media_type; /* static */
    enum coding coding;
    const char *etag; /* without quotes and without coding */
    bool alone;       /* it is not sent in other codings */
};

/* Status, type, coding and entity tag. */
void respond_representation(struct response *response, const struct representation *representation);

/* Answers with a cached value that is pinned, and says where it came from. */
void respond_body(struct exchange *exchange, const struct cache_value *value,
                  const struct representation *representation);

/* Prepares the answer 304 if the client has this representation already, so that it need not be made or read. */
bool respond_unchanged(struct exchange *exchange, const struct representation *representation, uint64_t size);

/* An answer of 200 whose body is not sent; it has so many bytes. */
void respond_absent(struct response *response, uint64_t size);

/* The response for a failure of the library. */
void respond_failure(struct exchange *exchange, const struct tetlod_error *error);

/* 503, where the answer itself has no room. ANSWERED. */
enum outcome respond_no_memory(struct exchange *exchange);

/* 503, where a file hangs. ANSWERED. */
enum outcome respond_hanging(struct exchange *exchange, const struct dataset *dataset);

/* The stream that the first capture names, held; NULL after a 404 with the ids that there are. */
struct dataset *named_dataset(struct exchange *exchange);

void cache_forever(struct exchange *exchange);
void cache_revalidate(struct response *response);

/* Adds the Link to the API's description, relative to the request's path. */
void link_description(struct exchange *exchange);

/* Passes an outcome on; a 200 may be kept forever. What is under a content id never changes. */
enum outcome answer_immutable(struct exchange *exchange, enum outcome outcome);

/* False after a 400 if the query has a parameter that the route does not know, or that is not one of `names`. */
bool check_parameters(struct exchange *exchange);
bool check_parameters_of(struct exchange *exchange, const char *names);

json_t *json_texts(const char *const *list, size_t count);
json_t *field_names(const struct tetlod_info *info);

/* The name under which a browser saves an answer of 200: the stream's id and what follows. */
void name_download(struct exchange *exchange, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Tetlod-Level, -Vertices, -Tets, -Error. */
void level_headers(struct response *response, const struct dataset *dataset, uint32_t level);

/* The stream that the first two captures (id, cid) name, held; NULL after a 404. */
struct dataset *captured_dataset(struct exchange *exchange);

/* A number below `count`; false after a 400. `name` is what it counts: "step". */
bool take_number(struct exchange *exchange, const char *text, const char *name, uint32_t count, uint32_t *out);

/* A level's number; false after a 400. */
bool parse_level(struct exchange *exchange, const struct tetlod_info *info, const char *text, uint32_t *out);

#endif
