/* SPDX-License-Identifier: BSD-3-Clause */
/* What a client may write: the first line of the input is a request target, the others are values of the headers that
 * are parsed. The handlers answer it over a stream `m`, whose content id stands for CID in a target, as a server that
 * is open to all and as one with a token, a base path and a list of origins. The promises of each parser and of every
 * answer are checked. */
#define _GNU_SOURCE
#include <assert.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "server/http/conditions.h"
#include "server/http/params.h"
#include "server/routes/routes.h"
#include "src/util/number_text.h"
#include "tests/gen.h"

static char cid[64];

/* The stream is open when its file goes again. */
static bool open_catalogue(struct site *site)
{
    char folder[] = "/tmp/tetlod-fuzz-XXXXXX", path[64];
    if (!mkdtemp(folder))
        return false;
    snprintf(path, sizeof path, "%s/m.tetlod", folder);
    const char *const paths[] = {folder};
    const struct gen_options made = {.kind = GEN_GRID, .seed = 1, .size = 2, .levels = 5, .arity = 2,
                                     .type = TETLOD_FLOAT32};
    const struct catalogue_options options = {.paths = paths, .path_count = 1};
    bool opened = gen_write(path, &made) && catalogue_open(&site->catalogue, &options, NULL) == TETLOD_OK;
    unlink(path);
    rmdir(folder);
    struct dataset *dataset = opened ? catalogue_find(site->catalogue, "m") : NULL;
    if (dataset)
        snprintf(cid, sizeof cid, "%s", dataset_info(dataset)->cid);
    dataset_release(dataset);
    return dataset != NULL;
}

static struct site *make_site(void)
{
    static struct site site;
    static const char *const routes[] = {"/", NULL};
    if (site.cache)
        return &site;
    site.cache = cache_new(1 << 20);
    site.memory = cache_new(1 << 24);
    site.metrics = metrics_new(routes);
    site.access = access_new();
    site.serve_metrics = true;
    if (!site.cache || !site.metrics || !site.access ||
        !open_catalogue(&site))
        abort();
    return &site;
}

static const char *const header_names[] = {"Range",  "If-Range",      "If-None-Match", "Accept-Encoding", "Accept",
                                           "Origin", "Authorization", "Host",          "Cookie"};
enum { RANGE, IF_RANGE, IF_NONE_MATCH, ACCEPT_ENCODING, HEADERS = sizeof header_names / sizeof *header_names };

/* A line that is not there is a header that is not sent. */
static const char *header(void *opaque, const char *name)
{
    char **lines = opaque;
    for (int i = 0; i < HEADERS; i++)
        if (strcasecmp(name, header_names[i]) == 0)
            return lines[i];
    return NULL;
}

static void check_parsers(const char *target, char *const *lines)
{
    char out[64], again[200];
    double number, numbers[3];
    uint64_t first = 0, length = 0, size = strlen(target);
    const char *query = strchr(target, '?'), *if_range = lines[IF_RANGE] ? lines[IF_RANGE] : "";
    if (percent_decode(target, strlen(target), out, sizeof out)) {
        char decoded[64];
        assert(strlen(out) < sizeof out);
        assert(percent_encode(out, again, sizeof again));
        assert(percent_decode(again, strlen(again), decoded, sizeof decoded) && strcmp(decoded, out) == 0);
    }
    if (query_value(query ? query + 1 : NULL, "error", out, sizeof out) == QUERY_FOUND &&
        text_number(out, true, &number))
        assert(isfinite(number));
    if (text_numbers(if_range, 3, numbers))
        assert(isfinite(numbers[0]) && isfinite(numbers[1]) && isfinite(numbers[2]));
    if (text_count(if_range, true, &first))
        assert(if_range[0] >= '0' && if_range[0] <= '9');
    if (range_parse(lines[RANGE], size, &first, &length) == RANGE_OK)
        assert(length && first < size && length <= size - first);
    assert(coding_choose(lines[ACCEPT_ENCODING], CODINGS_MADE | 1u << CODING_BROTLI) < CODINGS);
    if (etag_list_has(lines[IF_NONE_MATCH], "\"tag\""))
        assert(strchr(lines[IF_NONE_MATCH], '*') || strstr(lines[IF_NONE_MATCH], "\"tag\""));
}

/* No header is there twice, none holds what would begin another one; a problem is JSON that names its status. */
static void check_answer(const struct response *response)
{
    assert(response->status >= 200 && response->status < 600 && !response->headers_lost);
    for (size_t i = 0; i < response->header_count; i++) {
        for (size_t j = 0; j < i; j++)
            assert(strcasecmp(response->headers[i].name, response->headers[j].name) != 0);
        for (const char *c = response_header_value(response, i); *c; c++)
            assert((unsigned char)*c >= 0x20 && *c != 0x7f);
    }
    if (response->status < 400 || response->kind != BODY_BYTES ||
        strcmp(response->media_type, "application/problem+json") != 0)
        return;
    json_t *problem = json_loadb(response->bytes, (size_t)response->size, JSON_REJECT_DUPLICATES, NULL);
    assert(json_integer_value(json_object_get(problem, "status")) == response->status);
    json_decref(problem);
}

static void answer(struct site *site, const char *target, char **lines)
{
    static const enum method methods[] = {METHOD_GET, METHOD_HEAD, METHOD_OPTIONS, METHOD_OTHER};
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
        struct request request = {.method = methods[m], .target = target, .header = header, .opaque = lines,
                                  .loopback = !site->base_path};
        struct response response = {0};
        assert(site_answer(site, &request, &response) == ANSWERED);
        check_answer(&response);
        request_unpin(&request);
        response_release(&response);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    static const char *const origins[] = {"https://a.example"};
    static const struct access_policy open_to_all = {0}, guarded = {.origins = origins, .origin_count = 1,
                                                                    .token = "t0ken"};
    char *text = malloc(size + 1), *lines[HEADERS] = {0};
    if (!text)
        return 0;
    memcpy(text, bytes, size);
    text[size] = 0;
    char *rest = strchr(text, '\n');
    for (int i = 0; i < HEADERS && rest; i++) {
        *rest = 0;
        lines[i] = rest + 1;
        rest = strchr(rest + 1, '\n');
    }
    if (rest)
        *rest = 0;
    struct site *site = make_site();
    char target[4096];
    char *mark = strstr(text, "CID");
    snprintf(target, sizeof target, "%.*s%s%s", mark ? (int)(mark - text) : 0, text, mark ? cid : "",
             mark ? mark + 3 : text);
    check_parsers(text, lines);
    assert(access_set(site->access, &open_to_all));
    site->base_path = NULL;
    answer(site, target, lines);
    assert(access_set(site->access, &guarded));
    site->base_path = "/x/";
    answer(site, target, lines);
    free(text);
    return 0;
}
