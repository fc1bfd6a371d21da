/* SPDX-License-Identifier: BSD-3-Clause */
/* What a client may write: the first line of the input is a request target, the others are values of headers that are
 * parsed. Everything is answered by the handlers over a stream `m`, whose content id stands for CID in a target, and each parser's
 * promises are checked. */
#define _GNU_SOURCE
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "server/answer/routes.h"
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
    const struct gen_options made = {.kind = GEN_GRID, .seed = 1, .size = 2, .levels = 5, .arity = 2, .type = TETLOD_FLOAT32};
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
    site.serve_metrics = true;
    if (!site.cache || !site.metrics ||
        !open_catalogue(&site))
        abort();
    return &site;
}

struct headers {
    const char *range, *if_range, *if_none_match, *accept_encoding, *accept, *origin, *authorization;
};

static const char *header(void *opaque, const char *name)
{
    const struct headers *headers = opaque;
    return strcasecmp(name, "Range") == 0             ? headers->range
           : strcasecmp(name, "If-Range") == 0        ? headers->if_range
           : strcasecmp(name, "If-None-Match") == 0   ? headers->if_none_match
           : strcasecmp(name, "Accept-Encoding") == 0 ? headers->accept_encoding
           : strcasecmp(name, "Accept") == 0          ? headers->accept
           : strcasecmp(name, "Origin") == 0          ? headers->origin
           : strcasecmp(name, "Authorization") == 0   ? headers->authorization
                                                      : NULL;
}

static void check_parsers(const char *target, const struct headers *headers)
{
    char out[64], again[200];
    double number, numbers[3];
    uint64_t first = 0, length = 0, size = strlen(target);
    const char *query = strchr(target, '?');
    if (percent_decode(target, strlen(target), out, sizeof out)) {
        char decoded[64];
        assert(strlen(out) < sizeof out);
        assert(percent_encode(out, again, sizeof again));
        assert(percent_decode(again, strlen(again), decoded, sizeof decoded) && strcmp(decoded, out) == 0);
    }
    if (query_value(query ? query + 1 : NULL, "error", out, sizeof out) == QUERY_FOUND && text_number(out, true, &number))
        assert(isfinite(number));
    if (text_numbers(headers->if_range, 3, numbers))
        assert(isfinite(numbers[0]) && isfinite(numbers[1]) && isfinite(numbers[2]));
    if (text_count(headers->if_range, true, &first))
        assert(headers->if_range[0] >= '0' && headers->if_range[0] <= '9');
    if (range_parse(headers->range, size, &first, &length) == RANGE_OK)
        assert(length && first < size && length <= size - first);
    assert(coding_choose(headers->accept_encoding, CODINGS_MADE | 1u << CODING_BROTLI) < CODINGS);
    if (etag_list_has(headers->if_none_match, "\"tag\""))
        assert(strchr(headers->if_none_match, '*') || strstr(headers->if_none_match, "\"tag\""));
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    char *text = malloc(size + 1), *lines[8], *rest = text;
    if (!text)
        return 0;
    memcpy(text, bytes, size);
    text[size] = 0;
    for (int i = 0; i < 8; i++) {
        lines[i] = rest;
        rest += strcspn(rest, "\n");
        if (*rest)
            *rest++ = 0;
    }
    make_site();
    char target[4096];
    char *mark = strstr(lines[0], "CID");
    snprintf(target, sizeof target, "%.*s%s%s", mark ? (int)(mark - lines[0]) : 0, lines[0], mark ? cid : "", mark ? mark + 3 : lines[0]);
    struct headers headers = {lines[1], lines[2], lines[3], lines[4], lines[5], lines[6], lines[7]};
    check_parsers(lines[0], &headers);
    static const enum method methods[] = {METHOD_GET, METHOD_HEAD, METHOD_OPTIONS, METHOD_OTHER};
    for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
        struct request request = {.method = methods[m], .target = target, .header = header, .opaque = &headers};
        struct response response = {0};
        assert(site_answer(make_site(), &request, &response) == ANSWERED);
        assert(response.status >= 200 && response.status < 600);
        request_unpin(&request);
        response_release(&response);
    }
    free(text);
    return 0;
}
