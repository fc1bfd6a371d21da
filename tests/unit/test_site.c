/* SPDX-License-Identifier: BSD-3-Clause */
/* Handlers without sockets: a request as a struct in, a response as a struct out, over a folder of one stream. */
#define _GNU_SOURCE
#include <pthread.h>
#include <stdlib.h>
#include <strings.h>
#include <unistd.h>

#include "server/routes/routes.h"
#include "src/util/clock.h"
#include "tests/gen.h"
#include "tests/test.h"

struct fixture {
    char folder[64], path[96];
    struct site site;
    char cid[33];
    struct response response;
};

static bool write_stream(const char *path, uint64_t seed)
{
    return gen_write(path, &(struct gen_options){.kind = GEN_GRID, .seed = seed, .size = 3, .levels = 8, .arity = 2,
                                                 .type = TETLOD_FLOAT32});
}

static bool open_fixture(struct fixture *f, uint64_t cache_bytes, uint64_t checked_at_once)
{
    static const char *const routes[] = {NULL};
    memset(f, 0, sizeof *f);
    strcpy(f->folder, "/tmp/tetlod-site-XXXXXX");
    if (!mkdtemp(f->folder))
        return false;
    snprintf(f->path, sizeof f->path, "%s/m.tetlod", f->folder);
    const char *const paths[] = {f->folder};
    const struct catalogue_options options = {.paths = paths, .path_count = 1, .keep_replaced = 10,
                                              .checked_at_once = checked_at_once};
    f->site.cache = cache_new(cache_bytes);
    f->site.memory = cache_new(cache_bytes);
    f->site.metrics = metrics_new(routes);
    if (!write_stream(f->path, 1) || catalogue_open(&f->site.catalogue, &options, NULL) != TETLOD_OK)
        return false;
    struct dataset *dataset = catalogue_find(f->site.catalogue, "m");
    if (!dataset)
        return false;
    strcpy(f->cid, dataset_info(dataset)->cid);
    dataset_release(dataset);
    return true;
}

static void close_fixture(struct fixture *f)
{
    response_release(&f->response);
    cache_free(f->site.cache);
    cache_free(f->site.memory);
    catalogue_close(f->site.catalogue);
    metrics_free(f->site.metrics);
    unlink(f->path);
    rmdir(f->folder);
}

static const char *range_header(void *opaque, const char *name)
{
    return strcasecmp(name, "Range") == 0 ? opaque : NULL;
}

/* The answer to GET of a path under the stream's content id, or of a whole target if it starts with '/'. */
static unsigned get(struct fixture *f, const char *path, const char *range)
{
    char target[512], held_range[64];
    snprintf(held_range, sizeof held_range, "%s", range ? range : "");
    if (path[0] == '/')
        snprintf(target, sizeof target, "%s", path);
    else
        snprintf(target, sizeof target, "/v1/meshes/m/%s/%s", f->cid, path);
    struct request request = {.method = METHOD_GET, .target = target, .header = range ? range_header : NULL,
                              .opaque = held_range};
    response_release(&f->response);
    response_init(&f->response);
    CHECK_INT(site_answer(&f->site, &request, &f->response), ANSWERED);
    request_unpin(&request);
    return f->response.status;
}

static void test_answers(void)
{
    struct fixture f;
    REQUIRE(open_fixture(&f, 1 << 24, 0));
    CHECK_INT(get(&f, "/v1/meshes", NULL), 200);
    CHECK_INT(get(&f, "/v1/meshes/m", NULL), 200);
    CHECK_TEXT(f.response.media_type, "application/json");
    CHECK_INT(get(&f, "levels/2/mesh.vtu", NULL), 200);
    CHECK(f.response.size > 1000 && memcmp(f.response.bytes, "<?xml", 5) == 0);
    CHECK_TEXT(response_find_header(&f.response, "Tetlod-Level"), "2");
    CHECK_INT(get(&f, "stream", NULL), 200);
    uint64_t whole = f.response.size;
    CHECK_INT(get(&f, "stream", "bytes=4-9"), 206);
    CHECK_INT(f.response.kind, BODY_BYTES);
    CHECK_INT(f.response.offset, 4);
    CHECK_INT(f.response.size, 6);
    char content_range[64];
    snprintf(content_range, sizeof content_range, "bytes 4-9/%llu", (unsigned long long)whole);
    CHECK_TEXT(response_find_header(&f.response, "Content-Range"), content_range);
    CHECK_INT(get(&f, "stream", "bytes=999999999-"), 416);
    CHECK_INT(get(&f, "levels/0/slice.vtp?origin=0,0,0.5&normal=0,0,1", NULL), 200);
    CHECK_INT(get(&f, "/v1/meshes/m/mesh?tets=100", NULL), 303);
    CHECK(strstr(response_find_header(&f.response, "Location"), f.cid) != NULL);
    CHECK_INT(get(&f, "/v1/meshes/x", NULL), 404);
    CHECK_TEXT(f.response.media_type, "application/problem+json");
    CHECK_INT(get(&f, "/metrics", NULL), 404); // not on this site
    CHECK_INT(get(&f, "/readyz", NULL), 200);
    atomic_store(&f.site.draining, true);
    CHECK_INT(get(&f, "/readyz", NULL), 503);
    CHECK_TEXT(response_find_header(&f.response, "Retry-After"), "1");
    CHECK_INT(get(&f, "/healthz", NULL), 200);
    atomic_store(&f.site.draining, false);
    close_fixture(&f);
}

static bool flip(const char *path, long offset)
{
    FILE *file = fopen(path, "r+b");
    bool good = file && fseek(file, offset, SEEK_SET) == 0;
    int byte = good ? fgetc(file) : 0;
    good = good && fseek(file, offset, SEEK_SET) == 0 && fputc(byte ^ 1, file) != EOF;
    return file && fclose(file) == 0 && good;
}

/* What the first scan has no time for is checked part by part when it is read, and as a whole by the next scan. */
static void test_damage_that_is_found_later(void)
{
    struct fixture f;
    REQUIRE(open_fixture(&f, 1 << 24, 1));
    struct dataset *dataset = catalogue_find(f.site.catalogue, "m");
    REQUIRE(dataset);
    const struct tetlod_info *info = dataset_info(dataset);
    unsigned last = info->level_count - 1;
    char levels[32], mesh[48];
    snprintf(levels, sizeof levels, "records/%u-%u", last - 1, last);
    snprintf(mesh, sizeof mesh, "levels/%u/mesh.vtu", last);
    CHECK(!dataset_checked(dataset));
    REQUIRE(flip(f.path, (long)info->levels[last].offset));
    CHECK_INT(get(&f, "records/0-1", NULL), 200);
    CHECK_INT(get(&f, "stream", "bytes=0-99"), 503); // this file is so short that its window has all of it
    CHECK_INT(get(&f, levels, NULL), 503);
    CHECK_TEXT(response_find_header(&f.response, "Retry-After"), "1");
    CHECK_INT(get(&f, mesh, NULL), 503);
    CHECK(dataset_damaged(dataset));
    dataset_release(dataset);
    catalogue_scan(f.site.catalogue, monotonic_seconds());
    CHECK_INT(get(&f, "records/0-1", NULL), 404);
    REQUIRE(flip(f.path, 0)); // a header that is none, and back: the file is taken up again when it is good
    catalogue_scan(f.site.catalogue, monotonic_seconds());
    REQUIRE(flip(f.path, 0) && write_stream(f.path, 1));
    catalogue_scan(f.site.catalogue, monotonic_seconds());
    CHECK_INT(get(&f, levels, NULL), 200);
    close_fixture(&f);
}

static void test_cache_too_small(void)
{
    struct fixture f;
    REQUIRE(open_fixture(&f, 40000, 0));
    CHECK_INT(get(&f, "levels/2/mesh.vtu", NULL), 422);
    CHECK_INT(get(&f, "levels/2/mesh.tetlod", NULL), 200);
    close_fixture(&f);
}

static void test_replaced(void)
{
    struct fixture f;
    char old[48], current[48];
    REQUIRE(open_fixture(&f, 1 << 24, 0));
    snprintf(old, sizeof old, "%s", f.cid);
    char other[112];
    snprintf(other, sizeof other, "%s.new", f.path);
    REQUIRE(write_stream(other, 2) && rename(other, f.path) == 0);
    double now = monotonic_seconds();
    catalogue_scan(f.site.catalogue, now);
    CHECK_INT(get(&f, "records/0-1", NULL), 200); // still there for its readers
    struct dataset *dataset = catalogue_find(f.site.catalogue, "m");
    REQUIRE(dataset);
    snprintf(current, sizeof current, "%s", dataset_info(dataset)->cid);
    dataset_release(dataset);
    CHECK(strcmp(current, old) != 0);
    catalogue_scan(f.site.catalogue, now + 5);
    CHECK_INT(get(&f, "levels/0/mesh.vtk", NULL), 200);
    response_release(&f.response);
    catalogue_scan(f.site.catalogue, now + 60); // nobody has asked for longer than it is kept
    CHECK_INT(get(&f, "records/0-1", NULL), 404);
    strcpy(f.cid, current);
    CHECK_INT(get(&f, "records/0-1", NULL), 200);
    close_fixture(&f);
}

/* A request whose pins are all in use begins nothing that nobody would finish: the next one gets its answer. */
static void test_no_free_pin(void)
{
    struct fixture f;
    REQUIRE(open_fixture(&f, 1 << 24, 0));
    char target[128], key[8];
    snprintf(target, sizeof target, "/v1/meshes/m/%s/levels/2/mesh.vtu", f.cid);
    struct request full = {.method = METHOD_GET, .target = target};
    for (int i = 0; i < REQUEST_PINS; i++) {
        bool mine;
        const struct tetlod_error none = {.status = TETLOD_ERR_LIMIT};
        snprintf(key, sizeof key, "x%d", i);
        full.pins[i].cache = f.site.cache;
        full.pins[i].entry = cache_fetch(f.site.cache, key, &mine);
        REQUIRE(full.pins[i].entry);
        cache_finish(f.site.cache, full.pins[i].entry, NULL, &none);
    }
    response_init(&f.response);
    CHECK_INT(site_answer(&f.site, &full, &f.response), ANSWERED);
    CHECK_INT(f.response.status, 503);
    request_unpin(&full);
    CHECK_INT(get(&f, "levels/2/mesh.vtu", NULL), 200);
    CHECK(strstr(f.response.etag, TETLOD_VERSION_STRING) != NULL); // what is made may differ from version to version
    close_fixture(&f);
}

/* What happens when this thread next lets go of a lock: the scanner's thread may come in between there. */
static _Thread_local struct fixture *between;

int __real_pthread_mutex_unlock(pthread_mutex_t *lock);
int __wrap_pthread_mutex_unlock(pthread_mutex_t *lock);

int __wrap_pthread_mutex_unlock(pthread_mutex_t *lock)
{
    int result = __real_pthread_mutex_unlock(lock);
    struct fixture *f = between;
    between = NULL;
    if (f) {
        char other[112];
        snprintf(other, sizeof other, "%s.new", f->path);
        CHECK(write_stream(other, 2) && rename(other, f->path) == 0);
        catalogue_scan(f->site.catalogue, monotonic_seconds());
    }
    return result;
}

/* Streams and the name of their list are of one moment: else an old list lies under the name of the new one. */
static void test_list_and_its_name(void)
{
    for (int moment = 0; moment < 2; moment++) {
        struct fixture f;
        REQUIRE(open_fixture(&f, 1 << 24, 0));
        size_t count;
        uint64_t digest, now;
        between = moment ? NULL : &f;
        struct dataset **list = catalogue_list(f.site.catalogue, SIZE_MAX, &count, &digest);
        REQUIRE(list && count == 1);
        CHECK_TEXT(dataset_info(list[0])->cid, f.cid);
        now = catalogue_digest(f.site.catalogue);
        CHECK(moment ? now == digest : now != digest);
        dataset_release(list[0]);
        free(list);
        close_fixture(&f);
    }
}

int main(void)
{
    RUN(test_list_and_its_name);
    RUN(test_no_free_pin);
    RUN(test_answers);
    RUN(test_damage_that_is_found_later);
    RUN(test_cache_too_small);
    RUN(test_replaced);
    return test_end();
}
