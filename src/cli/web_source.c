/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/cli/web_source.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "format/fail.h"

bool web_source_is(const char *text)
{
    return strncasecmp(text, "http://", 7) == 0 || strncasecmp(text, "https://", 8) == 0;
}

#ifdef TETLOD_CURL

#include <curl/curl.h>
#include <jansson.h>
#include <stdio.h>

#include "src/util/array.h"

/* AHEAD: blocks that are fetched at least where something is read. A host that does not answer Range requests sends
 * all, which is kept. */
enum { BLOCK = 1 << 12, AHEAD = 16, MAX_URL = 4096, MAX_REDIRECTIONS = 10, SILENCE_SECONDS = 60, MAX_CONNECTIONS = 8 };

struct web_source {
    CURL *curl;
    char url[MAX_URL], problem[CURL_ERROR_SIZE + 64];
    uint64_t size;
    uint8_t *bytes; /* [size], of the blocks that are there */
    uint8_t *here;  /* [blocks] */
    bool whole;
};

/* What an answer brings. */
struct answer {
    uint8_t *bytes;
    size_t count, capacity;
    uint64_t total; /* of the whole, as Content-Range says; 0: it does not */
};

static size_t take_body(char *data, size_t one, size_t count, void *opaque)
{
    struct answer *answer = opaque;
    if (!array_reserve((void **)&answer->bytes, &answer->capacity, answer->count + count, one))
        return 0;
    memcpy(answer->bytes + answer->count, data, count);
    answer->count += count;
    return count;
}

static size_t take_header(char *line, size_t one, size_t count, void *opaque)
{
    static const char name[] = "content-range:";
    struct answer *answer = opaque;
    const char *slash = count > sizeof name && strncasecmp(line, name, sizeof name - 1) == 0
                            ? memchr(line, '/', count) : NULL;
    if (slash)
        answer->total = strtoull(slash + 1, NULL, 10);
    return one * count;
}

/* Prepares a GET of the URL, or of `range` of it. */
static void prepare(struct web_source *source, CURL *curl, const char *range, struct answer *answer)
{
    *answer = (struct answer){0};
    curl_easy_setopt(curl, CURLOPT_URL, source->url);
    curl_easy_setopt(curl, CURLOPT_RANGE, range);
    curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, take_body);
    curl_easy_setopt(curl, CURLOPT_WRITEDATA, answer);
    curl_easy_setopt(curl, CURLOPT_HEADERFUNCTION, take_header);
    curl_easy_setopt(curl, CURLOPT_HEADERDATA, answer);
}

/* The status of what was got; 0, and a problem, if there was none. */
static long status_of(struct web_source *source, CURL *curl, CURLcode done)
{
    long status = 0;
    curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &status);
    if (done != CURLE_OK && !source->problem[0])
        snprintf(source->problem, sizeof source->problem, "%s", curl_easy_strerror(done));
    else if (done == CURLE_OK && status != 200 && status != 206)
        snprintf(source->problem, sizeof source->problem, "the host answers with status %ld", status);
    return source->problem[0] ? 0 : status;
}

/* GETs the URL, or `range` of it. Returns the answer's status; 0 if there was none. */
static long get(struct web_source *source, const char *range, struct answer *answer)
{
    source->problem[0] = 0;
    prepare(source, source->curl, range, answer);
    return status_of(source, source->curl, curl_easy_perform(source->curl));
}

/* Blocks that are fetched in one request. */
struct run {
    uint64_t first, last;
    struct answer answer;
    CURL *curl;
};

static uint64_t run_end(const struct web_source *source, const struct run *run)
{
    return (run->last + 1) * BLOCK < source->size ? (run->last + 1) * BLOCK : source->size;
}

static void print_range(const struct web_source *source, const struct run *run, char out[static 64])
{
    snprintf(out, 64, "%llu-%llu", (unsigned long long)run->first * BLOCK,
             (unsigned long long)run_end(source, run) - 1);
}

/* Keeps what a request brought. */
static bool keep(struct web_source *source, struct run *run, long status)
{
    uint64_t begin = run->first * BLOCK;
    bool good = status == 206 && run->answer.total == source->size && run->answer.count == run_end(source, run) - begin;
    if (good) {
        memcpy(source->bytes + begin, run->answer.bytes, run->answer.count);
        memset(source->here + run->first, 1, run->last - run->first + 1);
    } else if (!source->problem[0]) {
        snprintf(source->problem, sizeof source->problem, "the file was replaced meanwhile; try again");
    }
    free(run->answer.bytes);
    run->answer = (struct answer){0};
    return good;
}

/* Fetches blocks `first` to `last`, which are not there. */
static bool fetch(struct web_source *source, uint64_t first, uint64_t last)
{
    struct run run = {.first = first, .last = last};
    char range[64];
    print_range(source, &run, range);
    long status = get(source, range, &run.answer);
    return keep(source, &run, status);
}

/* Adds the blocks of spans that are not there, in runs. */
static struct run *list_runs(const struct web_source *source, const struct tetlod_span *spans, size_t count,
                             size_t *out_count)
{
    uint8_t *wanted = array_zero(source->size / BLOCK + 1, 1);
    struct run *runs = NULL;
    size_t capacity = 0;
    *out_count = 0;
    for (size_t i = 0; i < count && wanted; i++)
        for (uint64_t at = spans[i].offset / BLOCK;
             at * BLOCK < spans[i].offset + spans[i].size && at * BLOCK < source->size; at++)
            wanted[at] = !source->here[at];
    for (uint64_t at = 0; wanted && at * BLOCK < source->size; at++) {
        if (!wanted[at])
            continue;
        if (at && wanted[at - 1])
            runs[*out_count - 1].last = at;
        else if (!ARRAY_PUSH(runs, *out_count, capacity, ((struct run){.first = at, .last = at})))
            break;
    }
    free(wanted);
    return runs;
}

static bool begin_run(struct web_source *source, CURLM *multi, struct run *run)
{
    char range[64];
    print_range(source, run, range);
    run->curl = curl_easy_duphandle(source->curl);
    if (!run->curl)
        return false;
    prepare(source, run->curl, range, &run->answer);
    curl_easy_setopt(run->curl, CURLOPT_ERRORBUFFER, NULL); // several would write there
    curl_easy_setopt(run->curl, CURLOPT_PRIVATE, run);
    return curl_multi_add_handle(multi, run->curl) == CURLM_OK;
}

/* Keeps what has come of all requests; false if one failed. */
static bool end_runs(struct web_source *source, CURLM *multi)
{
    int left;
    bool good = true;
    for (CURLMsg *message; (message = curl_multi_info_read(multi, &left));) {
        struct run *run = NULL;
        CURL *curl = message->easy_handle;
        CURLcode done = message->data.result;
        curl_easy_getinfo(curl, CURLINFO_PRIVATE, &run);
        long status = status_of(source, curl, done);
        curl_multi_remove_handle(multi, curl);
        curl_easy_cleanup(curl);
        run->curl = NULL;
        good = keep(source, run, status) && good;
    }
    return good;
}

/* All runs, at the same time over as many connections as there may be. */
static bool fetch_runs(struct web_source *source, struct run *runs, size_t count)
{
    CURLM *multi = curl_multi_init();
    bool good = multi != NULL;
    int running = 0;
    source->problem[0] = 0;
    if (good)
        curl_multi_setopt(multi, CURLMOPT_MAX_TOTAL_CONNECTIONS, (long)MAX_CONNECTIONS);
    for (size_t i = 0; i < count && good; i++)
        good = begin_run(source, multi, &runs[i]);
    do {
        good = good && curl_multi_perform(multi, &running) == CURLM_OK && end_runs(source, multi);
        if (good && running)
            good = curl_multi_poll(multi, NULL, 0, 1000, NULL) == CURLM_OK;
    } while (good && running);
    for (size_t i = 0; i < count; i++) {
        if (runs[i].curl && multi)
            curl_multi_remove_handle(multi, runs[i].curl);
        curl_easy_cleanup(runs[i].curl);
        free(runs[i].answer.bytes);
    }
    curl_multi_cleanup(multi);
    return good;
}

enum tetlod_status web_source_fetch(struct web_source *source, const struct tetlod_span *spans, size_t count,
                                    struct tetlod_error *error)
{
    size_t run_count;
    if (source->whole)
        return TETLOD_OK;
    struct run *runs = list_runs(source, spans, count, &run_count);
    bool good = !run_count || fetch_runs(source, runs, run_count);
    free(runs);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_IO, "cannot fetch its pages");
}

static enum tetlod_status read_bytes(void *opaque, uint64_t offset, void *buffer, size_t size)
{
    struct web_source *source = opaque;
    uint64_t last = size ? (offset + size - 1) / BLOCK : 0;
    for (uint64_t block = offset / BLOCK; size && block <= last && !source->whole; block++) {
        uint64_t end = block;
        if (source->here[block])
            continue;
        while ((end < last || end - block + 1 < AHEAD) && (end + 1) * BLOCK < source->size && !source->here[end + 1])
            end++;
        if (!fetch(source, block, end))
            return TETLOD_ERR_IO;
        block = end;
    }
    if (size)
        memcpy(buffer, source->bytes + offset, size);
    return TETLOD_OK;
}

/* The first blocks, which also say how large the whole is. */
static bool begin(struct web_source *source)
{
    struct answer answer;
    char range[32];
    snprintf(range, sizeof range, "0-%d", AHEAD * BLOCK - 1);
    long status = get(source, range, &answer);
    source->whole = status == 200;
    source->size = source->whole ? answer.count : answer.total;
    if (status && (!source->size || answer.count > source->size))
        snprintf(source->problem, sizeof source->problem, "the host does not say how long the file is");
    if (!source->problem[0]) {
        source->bytes = array_resize(answer.bytes, source->size, 1);
        source->here = array_zero(source->size / BLOCK + 1, 1);
        if (source->bytes)
            answer.bytes = NULL;
        if (!source->bytes || !source->here)
            snprintf(source->problem, sizeof source->problem, "out of memory");
        else
            memset(source->here, 1, AHEAD < source->size / BLOCK + 1 ? AHEAD : source->size / BLOCK + 1);
    }
    free(answer.bytes);
    return !source->problem[0];
}

/* A tetlod server's mesh, or the page that shows it: its stream is named by its content id. */
static void find_stream(struct web_source *source)
{
    char *bare = source->url, *id = strstr(bare, "/v1/meshes/"), *view = strstr(bare, "/view/");
    struct answer answer;
    if (!id && view && !strchr(view + 6, '/')) {
        char rest[MAX_URL];
        bare[strcspn(bare, "?#")] = 0;
        snprintf(rest, sizeof rest, "%s", view + 6);
        snprintf(view, (size_t)(source->url + MAX_URL - view), "/v1/meshes/%.2000s", rest);
        id = view;
    }
    if (!id || strchr(id + 11, '/') || get(source, NULL, &answer) != 200)
        return;
    json_t *json = json_loadb((const char *)answer.bytes, answer.count, 0, NULL);
    const char *cid = json_string_value(json_object_get(json, "cid"));
    size_t length = strlen(source->url);
    if (cid)
        snprintf(source->url + length, sizeof source->url - length, "/%s/stream", cid);
    json_decref(json);
    free(answer.bytes);
}

enum tetlod_status web_source_open(struct web_source **out, const char *url, struct tetlod_source *out_source,
                                   struct tetlod_error *error)
{
    struct web_source *source = *out = array_zero(1, sizeof *source);
    if (!source || !(source->curl = curl_easy_init()))
        return tetlodi_fail_nomem(error, "a request", sizeof *source);
    if ((size_t)snprintf(source->url, sizeof source->url, "%s", url) >= sizeof source->url)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "a URL has at most %d characters", MAX_URL - 1);
    curl_easy_setopt(source->curl, CURLOPT_ERRORBUFFER, source->problem);
    curl_easy_setopt(source->curl, CURLOPT_FOLLOWLOCATION, 1L);
    curl_easy_setopt(source->curl, CURLOPT_MAXREDIRS, (long)MAX_REDIRECTIONS);
    curl_easy_setopt(source->curl, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(source->curl, CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(source->curl, CURLOPT_LOW_SPEED_TIME, (long)SILENCE_SECONDS);
    curl_easy_setopt(source->curl, CURLOPT_USERAGENT, "tetlod/" TETLOD_VERSION_STRING);
    find_stream(source);
    if (!begin(source))
        return tetlodi_fail(error, TETLOD_ERR_IO, "cannot be read: %s", source->problem);
    *out_source = (struct tetlod_source){read_bytes, source, source->size};
    return TETLOD_OK;
}

void web_source_free(struct web_source *source)
{
    if (!source)
        return;
    if (source->curl)
        curl_easy_cleanup(source->curl);
    free(source->bytes);
    free(source->here);
    free(source);
}

const char *web_source_problem(const struct web_source *source)
{
    return source ? source->problem : "";
}

#else

enum tetlod_status web_source_open(struct web_source **out, const char *url, struct tetlod_source *out_source,
                                   struct tetlod_error *error)
{
    *out = NULL;
    (void)url;
    (void)out_source;
    return tetlodi_fail(error, TETLOD_ERR_IO, "this program was built without libcurl: fetch the file first");
}

enum tetlod_status web_source_fetch(struct web_source *source, const struct tetlod_span *spans, size_t count,
                                    struct tetlod_error *error)
{
    (void)source;
    (void)spans;
    (void)count;
    (void)error;
    return TETLOD_OK;
}

void web_source_free(struct web_source *source)
{
    (void)source;
}

const char *web_source_problem(const struct web_source *source)
{
    (void)source;
    return "";
}

#endif
