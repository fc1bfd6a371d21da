/* SPDX-License-Identifier: BSD-3-Clause */
/* What a client does with a cursor beside seeking: bounded steps, further fields, what changed, spans to fetch, memory
 * of its own. */
#include <stdlib.h>
#include <string.h>

#include "format/coding/pointer.h"
#include "format/common/allowance.h"
#include "format/read/reader.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/stream_fuzz.h"
#include "tests/test.h"

struct stream {
    struct recode recode;
    struct memory_sink memory;
    struct tetlod_file *file;
    const struct tetlod_info *info;
};

static const struct gen_options kinds[] = {{GEN_GRID, 3, 4, 7, 3, TETLOD_FLOAT32, 0, 0, 0},
                                           {GEN_HOLES, 4, 4, 6, 4, TETLOD_FLOAT64, 0, 12, 1},
                                           {GEN_SOUP, 5, 3, 5, 4, TETLOD_FLOAT64, 20, 9, 0}};
enum { KINDS = sizeof kinds / sizeof *kinds };

static int stream_open(struct stream *s, unsigned kind, const struct tetlod_options *options)
{
    *s = (struct stream){0};
    struct tetlodi_sink sink = memory_sink(&s->memory);
    if (!gen_make(&s->recode, &kinds[kind]))
        return 0;
    s->recode.input.keep_order = 1;
    if (tetlodi_write(&s->recode.input, &sink, NULL) != TETLOD_OK ||
        tetlod_open_memory(&s->file, s->memory.bytes, s->memory.size, options, NULL) != TETLOD_OK)
        return 0;
    s->info = tetlod_info(s->file);
    return 1;
}

static void stream_close(struct stream *s)
{
    tetlod_close(s->file);
    free(s->memory.bytes);
    gen_free(&s->recode);
}

/* How many of the two cursors' numbers differ. Fields that one of them does not have are not compared. */
static size_t differences(const struct stream *s, const struct tetlod_cursor *a, const struct tetlod_cursor *b)
{
    struct tetlod_mesh ma, mb;
    tetlod_cursor_mesh(a, &ma);
    tetlod_cursor_mesh(b, &mb);
    if (ma.vertices != mb.vertices || ma.tets != mb.tets || ma.level != mb.level)
        return 1;
    size_t wrong = memcmp(ma.positions, mb.positions, 24 * (size_t)ma.vertices) != 0;
    wrong += ma.tets && memcmp(ma.corners, mb.corners, 16 * (size_t)ma.tets) != 0;
    wrong += memcmp(ma.parents, mb.parents, 4 * (size_t)ma.vertices) != 0;
    for (uint32_t f = 0; f < s->info->field_count; f++)
        if (ma.fields[f] && mb.fields[f])
            wrong += memcmp(ma.fields[f], mb.fields[f], 8 * (size_t)ma.vertices * s->info->fields[f].components) != 0;
    return wrong;
}

/* Steps of any size lead where seeking leads, there and back, and no call does more than it may. */
static void test_step(void)
{
    for (unsigned kind = 0; kind < KINDS; kind++) {
        struct stream s;
        struct tetlod_cursor *a, *b;
        REQUIRE(stream_open(&s, kind, NULL));
        REQUIRE(tetlod_cursor_new(&a, s.file, NULL, 0, NULL) == TETLOD_OK &&
                tetlod_cursor_new(&b, s.file, NULL, 0, NULL) == TETLOD_OK);
        uint32_t targets[] = {1, s.info->level_count - 1, 0, s.info->level_count - 2, 2, s.info->level_count - 1,
                              1}, wrong = 0;
        for (uint32_t i = 0; i < 7; i++) {
            enum tetlod_status status;
            uint32_t calls = 0;
            do {
                struct tetlod_mesh before, after;
                tetlod_cursor_mesh(a, &before);
                status = tetlod_cursor_step(a, targets[i], 1 + i, NULL);
                tetlod_cursor_mesh(a, &after);
                uint32_t moved = after.vertices > before.vertices ? after.vertices - before.vertices
                                                                  : before.vertices - after.vertices;
                wrong += moved > 3 * (1 + i);
                if (++calls == 5) // elsewhere in between
                    wrong += tetlod_cursor_step(a, 0, 5, NULL) > TETLOD_MORE;
            } while (status == TETLOD_MORE);
            wrong +=
                status != TETLOD_OK || tetlod_cursor_seek(b, targets[i], NULL) != TETLOD_OK || differences(&s, a, b);
        }
        CHECK_INT(wrong, 0);
        CHECK_INT(tetlod_cursor_step(a, s.info->level_count, 1, NULL), TETLOD_ERR_ARGUMENT);
        tetlod_cursor_free(a);
        tetlod_cursor_free(b);
        stream_close(&s);
    }
}

/* A field that comes later is as if it had been there. */
static void test_add_field(void)
{
    for (unsigned kind = 0; kind < KINDS; kind++) {
        struct stream s;
        struct tetlod_cursor *all, *some;
        uint32_t first = 1, wrong = 0;
        REQUIRE(stream_open(&s, kind, NULL));
        for (uint32_t level = 0; level < s.info->level_count; level++)
            for (unsigned more = 0; more < 3; more += 2) {
                struct tetlod_mesh mesh;
                REQUIRE(tetlod_cursor_new(&all, s.file, NULL, 0, NULL) == TETLOD_OK);
                REQUIRE(tetlod_cursor_new(&some, s.file, &first, 1, NULL) == TETLOD_OK);
                wrong += tetlod_cursor_seek(some, level, NULL) != TETLOD_OK ||
                         tetlod_cursor_seek(all, level, NULL) != TETLOD_OK;
                for (unsigned i = 0; i < more; i++)
                    wrong +=
                        tetlod_cursor_refine(some, NULL) > TETLOD_END || tetlod_cursor_refine(all, NULL) > TETLOD_END;
                wrong += tetlod_cursor_add_field(some, 0, NULL) != TETLOD_OK;
                tetlod_cursor_mesh(some, &mesh);
                wrong += !mesh.fields[0] || differences(&s, all, some);
                wrong += tetlod_cursor_add_field(some, s.info->field_count,
                                                 NULL) != TETLOD_ERR_ARGUMENT || differences(&s, all, some);
                wrong += tetlod_cursor_seek(some, s.info->level_count - 1, NULL) != TETLOD_OK;
                wrong +=
                    tetlod_cursor_seek(all, s.info->level_count - 1, NULL) != TETLOD_OK || differences(&s, all, some);
                tetlod_cursor_free(all);
                tetlod_cursor_free(some);
            }
        CHECK_INT(wrong, 0);
        stream_close(&s);
    }
}

/* Is a number in a list? */
static int listed(const uint32_t *list, uint32_t count, uint32_t number)
{
    for (uint32_t i = 0; i < count; i++)
        if (list[i] == number)
            return 1;
    return 0;
}

/* What is not among the changes is the same at the coarser level, and what is differs, but for values that are given
 * twice. */
static void check_changes(const struct stream *s, struct tetlod_cursor *cursor, uint32_t level,
                          const uint32_t *vertices, uint32_t vertex_count,
                          const uint32_t *tets, uint32_t tet_count)
{
    struct tetlod_mesh now, before;
    struct tetlod_cursor *other;
    size_t wrong = 0, same = 0;
    REQUIRE(tetlod_cursor_new(&other, s->file, NULL, 0, NULL) == TETLOD_OK &&
            tetlod_cursor_seek(other, level, NULL) == TETLOD_OK);
    tetlod_cursor_mesh(cursor, &now);
    tetlod_cursor_mesh(other, &before);
    for (uint32_t v = 0; v < before.vertices; v++) {
        int differs = memcmp(now.positions + 3 * v, before.positions + 3 * v, 24) != 0;
        for (uint32_t f = 0; f < s->info->field_count; f++) {
            size_t n = s->info->fields[f].components;
            differs |= memcmp(now.fields[f] + n * v, before.fields[f] + n * v, 8 * n) != 0;
        }
        wrong += differs && !listed(vertices, vertex_count, v);
        same += !differs && listed(vertices, vertex_count, v);
    }
    for (uint32_t t = 0; t < before.tets; t++)
        wrong += listed(tets, tet_count, t) != (memcmp(now.corners + 4 * t, before.corners + 4 * t, 16) != 0);
    CHECK_INT(wrong, 0);
    CHECK(same <= vertex_count / 2 || now.level + 1 == s->info->level_count);
    tetlod_cursor_free(other);
}

static void test_changes(void)
{
    for (unsigned kind = 0; kind < KINDS; kind++) {
        struct stream s;
        struct tetlod_cursor *cursor;
        uint32_t vertices[2000], tets[2000], vertex_count, tet_count;
        REQUIRE(stream_open(&s, kind, NULL) && s.info->vertices < 2000 && s.info->tets < 2000);
        REQUIRE(tetlod_cursor_new(&cursor, s.file, NULL, 0, NULL) == TETLOD_OK);
        CHECK_INT(tetlod_cursor_changes(cursor, 1, vertices, &vertex_count, tets, &tet_count, NULL),
                  TETLOD_ERR_ARGUMENT);
        for (uint32_t to = 0; to < s.info->level_count; to++)
            for (uint32_t from = 0; from <= to; from++) {
                REQUIRE(tetlod_cursor_seek(cursor, to, NULL) == TETLOD_OK);
                REQUIRE(tetlod_cursor_changes(cursor, from, vertices, &vertex_count, tets, &tet_count,
                                              NULL) == TETLOD_OK);
                CHECK(from < to || (vertex_count == 0 && tet_count == 0));
                check_changes(&s, cursor, from, vertices, vertex_count, tets, tet_count);
            }
        tetlod_cursor_free(cursor);
        stream_close(&s);
    }
}

static void test_floats(void)
{
    struct stream s;
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;
    float out[3000];
    uint32_t field = 1, wrong = 0;
    REQUIRE(stream_open(&s, 1, NULL) && s.info->fields[1].components == 2);
    REQUIRE(tetlod_cursor_new(&cursor, s.file, &field, 1, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_seek(cursor, 3, NULL) == TETLOD_OK);
    tetlod_cursor_mesh(cursor, &mesh);
    REQUIRE(mesh.vertices <= 1000 &&
            tetlod_cursor_floats(cursor, TETLOD_NONE, 0, mesh.vertices, out, NULL) == TETLOD_OK);
    for (uint32_t i = 0; i < 3 * mesh.vertices; i++)
        wrong += out[i] != (float)mesh.positions[i];
    REQUIRE(mesh.vertices > 3 && tetlod_cursor_floats(cursor, 1, 2, mesh.vertices - 2, out, NULL) == TETLOD_OK);
    for (uint32_t i = 0; i < 2 * (mesh.vertices - 2); i++)
        wrong += out[i] != (float)mesh.fields[1][4 + i];
    CHECK_INT(wrong, 0);
    CHECK_INT(tetlod_cursor_floats(cursor, 0, 0, 1, out, NULL), TETLOD_ERR_FIELD);
    CHECK_INT(tetlod_cursor_floats(cursor, 1, mesh.vertices, 1, out, NULL), TETLOD_ERR_ARGUMENT);
    tetlod_cursor_free(cursor);
    stream_close(&s);
}

/* The bytes of the spans, one after the other, are what a feed of those fields takes. */
static void test_spans(void)
{
    struct stream s;
    REQUIRE(stream_open(&s, 2, NULL));
    uint32_t last = s.info->level_count - 1;
    struct tetlod_span spans[100];
    REQUIRE(tetlod_spans(s.file, TETLOD_NONE, last, NULL, 0, spans, 100) == 1);
    CHECK_INT(spans[0].offset, 0);
    CHECK_INT(spans[0].size, s.info->levels[last].end);
    REQUIRE(tetlod_spans(s.file, 0, 2, NULL, 0, spans, 100) == 1);
    CHECK_INT(spans[0].offset, s.info->levels[1].offset);
    CHECK_INT(spans[0].size, s.info->levels[2].end - s.info->levels[1].offset);
    CHECK_INT(tetlod_spans(s.file, 2, 2, NULL, 0, spans, 100), 0);
    for (uint32_t field = 0; field < s.info->field_count; field++) {
        struct tetlod_feed *feed;
        size_t count = tetlod_spans(s.file, TETLOD_NONE, last, &field, 1, spans, 100);
        REQUIRE(count > 1 && count <= 100 && tetlod_spans(s.file, TETLOD_NONE, last, &field, 1, NULL, 0) == count);
        REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
        REQUIRE(tetlod_feed_select(feed, &s.info->fields[field].name, 1, NULL) == TETLOD_OK);
        for (size_t i = 0; i < count; i++)
            REQUIRE(tetlod_feed_add(feed, s.memory.bytes + spans[i].offset, (size_t)spans[i].size,
                                    NULL) <= TETLOD_MORE);
        CHECK_INT(tetlod_feed_level(feed), last);
        tetlod_feed_free(feed);
    }
    stream_close(&s);
}

/* What is dropped is not wanted any more by a cursor that has it; a later cursor gets an error. */
static void test_drop(void)
{
    struct stream s;
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor, *late, *reference;
    REQUIRE(stream_open(&s, 1, NULL));
    uint32_t last = s.info->level_count - 1;
    REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
    REQUIRE(tetlod_feed_add(feed, s.memory.bytes, (size_t)s.info->levels[2].end, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&cursor, tetlod_feed_file(feed), NULL, 0, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_seek(cursor, 1, NULL) == TETLOD_OK);
    tetlod_feed_drop(feed, 1);
    tetlod_feed_drop(feed, 0);
    CHECK_INT(tetlod_cursor_new(&late, tetlod_feed_file(feed), NULL, 0, NULL), TETLOD_ERR_TRUNCATED);
    REQUIRE(tetlod_feed_add(feed, s.memory.bytes + s.info->levels[2].end,
                            s.memory.size - (size_t)s.info->levels[2].end, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(cursor, last, NULL), TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(cursor, 0, NULL), TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&reference, s.file, NULL, 0, NULL) == TETLOD_OK);
    CHECK(differences(&s, cursor, reference) == 0);
    CHECK_INT(tetlod_feed_add(feed, "more", 4, NULL), TETLOD_ERR_STREAM);
    tetlod_cursor_free(cursor);
    tetlod_cursor_free(reference);
    tetlod_feed_free(feed);
    stream_close(&s);
}

/* An HDF5 file with a stream in it, in pieces of any size: what is before and behind is passed (SPEC 3.10). */
static void test_feed_inside(void)
{
    enum { BEFORE = 700, BEHIND = 90 };
    struct stream s;
    REQUIRE(stream_open(&s, 1, NULL));
    struct tetlodi_pointer pointer = {BEFORE, s.memory.size};
    size_t size = BEFORE + s.memory.size + BEHIND;
    uint8_t *file = malloc(size);
    REQUIRE(file != NULL);
    memset(file, 7, size);
    memcpy(file + BEFORE, s.memory.bytes, s.memory.size);
    tetlodi_pointer_encode(&pointer, file);
    for (size_t step = 1; step < 4096; step = 3 * step + 5) {
        struct tetlod_feed *feed;
        struct tetlod_cursor *cursor, *reference;
        REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
        for (size_t at = 0; at < size; at += step) {
            enum tetlod_status status = tetlod_feed_add(feed, file + at, size - at < step ? size - at : step, NULL);
            REQUIRE(status == TETLOD_OK || (status == TETLOD_MORE && !tetlod_feed_file(feed)));
        }
        REQUIRE(tetlod_feed_level(feed) == s.info->level_count - 1);
        REQUIRE(tetlod_cursor_new(&cursor, tetlod_feed_file(feed), NULL, 0, NULL) == TETLOD_OK);
        REQUIRE(tetlod_cursor_new(&reference, s.file, NULL, 0, NULL) == TETLOD_OK);
        REQUIRE(tetlod_cursor_seek(cursor, s.info->level_count - 1, NULL) == TETLOD_OK);
        REQUIRE(tetlod_cursor_seek(reference, s.info->level_count - 1, NULL) == TETLOD_OK);
        CHECK(differences(&s, cursor, reference) == 0);
        tetlod_cursor_free(cursor);
        tetlod_cursor_free(reference);
        tetlod_feed_free(feed);
    }
    struct tetlod_feed *feed;
    pointer.size++;
    tetlodi_pointer_encode(&pointer, file);
    REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_feed_add(feed, file, size, NULL), TETLOD_ERR_STREAM);
    tetlod_feed_free(feed);
    file[9] ^= 1;
    REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_feed_add(feed, file, size, NULL), TETLOD_ERR_CHECKSUM);
    tetlod_feed_free(feed);
    free(file);
    stream_close(&s);
}

struct heap {
    size_t blocks, calls, fails_after;
};

static void *heap_allocate(void *opaque, void *block, size_t size)
{
    struct heap *heap = opaque;
    heap->calls++;
    if (size && heap->calls > heap->fails_after)
        return NULL;
    heap->blocks += size && !block ? 1u : 0u;
    heap->blocks -= !size && block ? 1u : 0u;
    if (size)
        return realloc(block, size);
    free(block);
    return NULL;
}

/* A cursor's arrays come from where the caller says, all go back, and each refusal is an error. */
static void test_allocator(void)
{
    struct heap heap = {.fails_after = SIZE_MAX};
    struct tetlod_options options = {.struct_size = sizeof options, .allocate = heap_allocate, .opaque = &heap};
    struct stream s;
    struct tetlod_cursor *cursor;
    REQUIRE(stream_open(&s, 0, &options));
    REQUIRE(tetlod_cursor_new(&cursor, s.file, NULL, 0, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(cursor, s.info->level_count - 1, NULL), TETLOD_OK);
    CHECK(heap.blocks > 8);
    size_t calls = heap.calls, failed = 0;
    tetlod_cursor_free(cursor);
    CHECK_INT(heap.blocks, 0);
    for (size_t after = 0; after < calls; after += 3) {
        heap = (struct heap){.fails_after = after};
        enum tetlod_status status = tetlod_cursor_new(&cursor, s.file, NULL, 0, NULL);
        if (status == TETLOD_OK)
            status = tetlod_cursor_seek(cursor, s.info->level_count - 1, NULL);
        failed += status == TETLOD_ERR_NOMEM;
        tetlod_cursor_free(cursor);
        CHECK_INT(heap.blocks, 0);
    }
    CHECK(failed > 3);
    stream_close(&s);
}

/* A caller's limit of memory, and without one what SPEC 2.3 allows a file of these bytes. */
static void test_memory_budget(void)
{
    struct stream s;
    struct tetlod_options options = {.struct_size = sizeof options, .max_bytes = 1000};
    size_t beyond = 0;
    for (enum tetlod_status status = TETLOD_ERR_LIMIT; status == TETLOD_ERR_LIMIT; options.max_bytes *= 2) {
        struct tetlod_cursor *cursor = NULL;
        struct tetlod_error error = {0};
        if (stream_open(&s, 0, &options)) {
            status = tetlod_cursor_new(&cursor, s.file, NULL, s.info->level_count - 1, &error);
            beyond += status == TETLOD_ERR_LIMIT && strstr(error.message, "bytes of memory allowed");
        }
        tetlod_cursor_free(cursor);
        stream_close(&s);
    }
    CHECK(beyond > 0);
    options.max_bytes = 0;
    REQUIRE(stream_open(&s, 0, &options));
    CHECK_INT(tetlodi_memory_limit(s.file), MEMORY_FREE + MEMORY_PER_BYTE * s.info->bytes);
    stream_close(&s);
}

/* A caller that was compiled with fewer options has those it knows. */
static void test_older_options(void)
{
    struct stream s;
    struct tetlod_options options = {.struct_size = offsetof(struct tetlod_options, allocate), .max_bytes = 100};
    CHECK(!stream_open(&s, 0, &options) && s.memory.size > 1000);
    options.allocate = heap_allocate; // not his
    options.max_bytes = 1 << 30;
    stream_close(&s);
    REQUIRE(stream_open(&s, 0, &options));
    struct tetlod_cursor *cursor;
    REQUIRE(tetlod_cursor_new(&cursor, s.file, NULL, 0, NULL) == TETLOD_OK);
    tetlod_cursor_free(cursor);
    stream_close(&s);
    options.struct_size = sizeof(size_t);
    options.max_bytes = 1;
    REQUIRE(stream_open(&s, 0, &options));
    stream_close(&s);
}

/* Opens bytes for one thread and for three, goes up as far as both lead, and counts what differs: meshes, failures. */
static size_t compare_threads(const uint8_t *bytes, size_t size)
{
    struct stream s[2];
    struct tetlod_cursor *cursors[2];
    struct tetlod_error errors[2] = {{0}, {0}};
    enum tetlod_status status[2];
    for (int i = 0; i < 2; i++) {
        const struct tetlod_options options = {.struct_size = sizeof options, .threads = 1 + 2 * (uint32_t)i};
        if (tetlod_open_memory(&s[i].file, bytes, size, &options, NULL) != TETLOD_OK)
            return 1;
        s[i].info = tetlod_info(s[i].file);
        status[i] = tetlod_cursor_new(&cursors[i], s[i].file, NULL, 0, &errors[i]);
    }
    size_t wrong = status[0] != status[1];
    if (!wrong && status[0] == TETLOD_OK) {
        const uint32_t targets[] = {1, s->info->level_count - 1, 0, s->info->level_count - 1};
        for (int t = 0; t < 4; t++) {
            for (int i = 0; i < 2; i++)
                status[i] = tetlod_cursor_seek(cursors[i], targets[t], &errors[i]);
            wrong += status[0] != status[1] || differences(s, cursors[0], cursors[1]);
        }
    }
    wrong += strcmp(errors[0].message, errors[1].message) != 0;
    for (int i = 0; i < 2; i++) {
        tetlod_cursor_free(cursors[i]);
        tetlod_close(s[i].file);
    }
    return wrong;
}

/* Any number of threads decodes the same, and finds the same damage. */
static void test_threads(void)
{
    const struct gen_options more[] = {{GEN_GRID, 6, 8, 3, 3, TETLOD_FLOAT32, 0, 12, 0},
                                       {GEN_HOLES, 7, 7, 9, 4, TETLOD_FLOAT64, 20, 0, 0}};
    for (int kind = 0; kind < 2; kind++) {
        struct recode recode;
        struct memory_sink memory = {0};
        struct tetlodi_sink sink = memory_sink(&memory);
        uint64_t random = 1;
        size_t size, wrong = 0;
        REQUIRE(gen_make(&recode, &more[kind]) && tetlodi_write(&recode.input, &sink, NULL) == TETLOD_OK);
        uint8_t *plain = stream_fuzz_plain(memory.bytes, memory.size, &size), *damaged = malloc(size);
        REQUIRE(plain && damaged);
        wrong += compare_threads(plain, size);
        for (int i = 0; i < 24; i++) {
            memcpy(damaged, plain, size);
            damaged[size / 2 + gen_random(&random) % (size / 2)] ^= (uint8_t)(1 + gen_random(&random) % 255);
            stream_fuzz_seal(damaged, size);
            wrong += compare_threads(damaged, size);
        }
        CHECK_INT(wrong, 0);
        free(damaged);
        free(plain);
        free(memory.bytes);
        gen_free(&recode);
    }
}

int main(void)
{
    RUN(test_threads);
    RUN(test_step);
    RUN(test_add_field);
    RUN(test_changes);
    RUN(test_floats);
    RUN(test_spans);
    RUN(test_drop);
    RUN(test_feed_inside);
    RUN(test_allocator);
    RUN(test_memory_budget);
    RUN(test_older_options);
    return test_end();
}
