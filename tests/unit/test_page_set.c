/* SPDX-License-Identifier: BSD-3-Clause */
/* Closed sets of pages: what they hold, which bytes they need, and cursors that have some pages and then others. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "tests/test.h"

#include "format/tetlod.h"

static struct tetlod_file *file;
static const struct tetlod_info *info;
static uint8_t *bytes;
static size_t size;

/* Nothing can be tested without. */
static void must(bool good)
{
    if (good)
        return;
    printf("Bail out! a stream or a cursor could not be had\n");
    exit(1);
}

static uint8_t *read_golden(const char *name, size_t *out_size)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/tests/golden/%s", getenv("ROOT") ? getenv("ROOT") : ".", name);
    FILE *in = fopen(path, "rb");
    must(in != NULL);
    uint8_t *read = malloc(1 << 20);
    must(read != NULL);
    *out_size = fread(read, 1, 1 << 20, in);
    fclose(in);
    return read;
}

static void open_stream(void)
{
    bytes = read_golden("paged_float32.tetlod", &size);
    must(tetlod_open_memory(&file, bytes, size, NULL, NULL) == TETLOD_OK);
    info = tetlod_info(file);
    must(info->page_count > 100 && info->first_paged_level > 1 && info->exact_last);
}

static uint32_t finest(void)
{
    return info->level_count - 2;
}

static uint32_t chance(uint32_t *state, uint32_t below)
{
    *state = *state * 1664525u + 1013904223u;
    return (uint32_t)(((uint64_t)*state * below) >> 32);
}

/* Some pages at random, and what they need. */
static struct tetlod_page_set *random_set(uint32_t *state, uint32_t pages)
{
    struct tetlod_page_set *set;
    must(tetlod_page_set_new(&set, file, 0, NULL, 0, NULL) == TETLOD_OK);
    for (uint32_t i = 0; i < pages; i++) {
        uint32_t level = info->first_paged_level + chance(state, finest() - info->first_paged_level + 1);
        CHECK_INT(tetlod_page_set_add(set, level, chance(state, tetlod_page_count(file, level)), NULL), TETLOD_OK);
    }
    return set;
}

static struct tetlod_cursor *cursor_with(struct tetlod_file *from, const struct tetlod_page_set *set)
{
    struct tetlod_page_set_info what;
    struct tetlod_cursor *cursor;
    tetlod_page_set_info(set, &what);
    must(tetlod_cursor_new(&cursor, from, NULL, 0, NULL) == TETLOD_OK);
    must(tetlod_cursor_select(cursor, set, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(cursor, what.level, NULL), TETLOD_OK);
    return cursor;
}

static bool same(const struct tetlod_cursor *a, const struct tetlod_cursor *b)
{
    struct tetlod_mesh x, y;
    tetlod_cursor_mesh(a, &x);
    tetlod_cursor_mesh(b, &y);
    return x.vertices == y.vertices && x.tets == y.tets && x.level == y.level &&
           memcmp(x.positions, y.positions, x.vertices * 3 * sizeof(double)) == 0 &&
           memcmp(x.corners, y.corners, x.tets * 4 * sizeof(uint32_t)) == 0 &&
           memcmp(x.fields[0], y.fields[0], x.vertices * sizeof(double)) == 0;
}

/* The needed pages are there, what is needed cannot be taken out, and the counts are those of the mesh. */
static void test_closed(void)
{
    uint32_t state = 1;
    for (int trial = 0; trial < (SANITIZED ? 16 : 40); trial++) {
        struct tetlod_page_set *set = random_set(&state, 1 + chance(&state, 6));
        struct tetlod_page_set_info what;
        uint32_t pages = 0, removed = 0;
        tetlod_page_set_info(set, &what);
        for (uint32_t level = info->first_paged_level; level <= finest(); level++)
            for (uint32_t p = 0; p < tetlod_page_count(file, level); p++) {
                struct tetlod_page page;
                if (!tetlod_page_set_has(set, level, p))
                    continue;
                pages++;
                CHECK_INT(tetlod_page(file, level, p, &page, NULL), TETLOD_OK);
                for (uint32_t i = 0; i < page.needed_count; i++) {
                    CHECK(tetlod_page_set_has(set, level - 1, page.needed[i]));
                    CHECK_INT(tetlod_page_set_remove(set, level - 1, page.needed[i], NULL), TETLOD_ERR_ARGUMENT);
                }
            }
        CHECK_INT(pages, what.pages);
        struct tetlod_cursor *cursor = cursor_with(file, set);
        struct tetlod_mesh mesh;
        tetlod_cursor_mesh(cursor, &mesh);
        CHECK_INT(mesh.vertices, what.vertices);
        CHECK_INT(mesh.tets, what.tets);
        tetlod_cursor_free(cursor);
        for (uint32_t level = finest(); level >= info->first_paged_level; level--) // the finest first: none is needed
            for (uint32_t p = 0; p < tetlod_page_count(file, level); p++)
                removed += tetlod_page_set_remove(set, level, p, NULL) == TETLOD_OK;
        CHECK_INT(removed, pages);
        tetlod_page_set_free(set);
    }
}

/* A cursor that had other pages before is as a new one; steps and records lead where seeking leads. */
static void test_moves(void)
{
    uint32_t state = 7;
    struct tetlod_cursor *cursor;
    REQUIRE(tetlod_cursor_new(&cursor, file, NULL, 0, NULL) == TETLOD_OK);
    for (int trial = 0; trial < (SANITIZED ? 16 : 40); trial++) {
        struct tetlod_page_set *set = random_set(&state, chance(&state, 8));
        struct tetlod_page_set_info what;
        struct tetlod_cursor *fresh = cursor_with(file, set);
        tetlod_page_set_info(set, &what);
        if (trial % 5 == 4) { // all pages and the exact values in between
            CHECK_INT(tetlod_cursor_select(cursor, NULL, NULL), TETLOD_OK);
            CHECK_INT(tetlod_cursor_seek(cursor, trial % 2 ? info->level_count - 1 : finest() - 3, NULL), TETLOD_OK);
        }
        CHECK_INT(tetlod_cursor_select(cursor, set, NULL), TETLOD_OK);
        enum tetlod_status status = TETLOD_MORE;
        if (trial % 3 == 0)
            status = tetlod_cursor_seek(cursor, what.level, NULL);
        while (trial % 3 == 1 && status == TETLOD_MORE)
            status = tetlod_cursor_step(cursor, what.level, 1 + chance(&state, 9), NULL);
        while (trial % 3 == 2 && (status = tetlod_cursor_refine(cursor, NULL)) == TETLOD_OK)
            continue;
        CHECK_INT(status, trial % 3 == 2 ? TETLOD_END : TETLOD_OK);
        CHECK(same(cursor, fresh));
        if (trial % 7 == 0) { // leaves in the middle of a level
            CHECK_INT(tetlod_cursor_seek(cursor, 0, NULL), TETLOD_OK);
            CHECK_INT(tetlod_cursor_step(cursor, what.level, 1 + chance(&state, 700), NULL) < TETLOD_END, 1);
        }
        tetlod_cursor_free(fresh);
        tetlod_page_set_free(set);
    }
    tetlod_cursor_free(cursor);
}

struct counted {
    unsigned reads;
};

static enum tetlod_status read_counted(void *opaque, uint64_t offset, void *buffer, size_t length)
{
    struct counted *counted = opaque;
    counted->reads++;
    memcpy(buffer, bytes + offset, length);
    return TETLOD_OK;
}

/* Also in what its log, its numbers and its levels say. */
static bool same_all_the_way(struct tetlod_cursor *a, struct tetlod_cursor *b, uint32_t *state)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(a, &mesh);
    uint32_t *of[4], level = mesh.level, down = chance(state, 400);
    for (int i = 0; i < 4; i++) {
        of[i] = calloc(mesh.tets, 2 * sizeof *of[i]);
        must(of[i] != NULL);
    }
    tetlod_cursor_numbers(a, of[0], of[0] + mesh.tets);
    tetlod_cursor_numbers(b, of[1], of[1] + mesh.tets);
    tetlod_cursor_tet_levels(a, of[2]);
    tetlod_cursor_tet_levels(b, of[3]);
    bool good = same(a, b) && memcmp(of[0], of[1], 2 * mesh.tets * sizeof *of[0]) == 0 &&
                memcmp(of[2], of[3], mesh.tets * sizeof *of[2]) == 0;
    for (int i = 0; i < 4; i++)
        free(of[i]);
    if (good && chance(state, 4) == 0) {
        good = tetlod_cursor_step(a, 0, down, NULL) == tetlod_cursor_step(b, 0, down, NULL) && same(a, b);
        good = good && tetlod_cursor_seek(a, level, NULL) == TETLOD_OK;
    }
    return good;
}

/* Pages that come and go one by one leave what a new cursor has. Nothing is read of those that go, and of those that
 * come nothing but their own frames. */
static void test_walk(void)
{
    uint32_t state = 23, gone = 0, steps = SANITIZED ? 80 : 300;
    struct counted counted = {0};
    struct tetlod_source source = {read_counted, &counted, size};
    struct tetlod_file *own;
    struct tetlod_page_set *set, *mirror;
    struct tetlod_cursor *cursor;
    REQUIRE(tetlod_open(&own, &source, NULL, NULL) == TETLOD_OK);
    REQUIRE(tetlod_page_set_new(&set, own, 0, NULL, 0, NULL) == TETLOD_OK);
    REQUIRE(tetlod_page_set_new(&mirror, file, 0, NULL, 0, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&cursor, own, NULL, 0, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_cursor_select(cursor, set, NULL), TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(cursor, info->first_paged_level - 1, NULL), TETLOD_OK);
    for (uint32_t step = 0; step < steps; step++) {
        struct tetlod_page_set_info before, after;
        bool goes = step % 40 > 20; // it grows and shrinks
        tetlod_page_set_info(set, &before);
        for (int tries = 0; tries < 400; tries++) {
            uint32_t level = info->first_paged_level + chance(&state, finest() - info->first_paged_level + 1);
            uint32_t page = chance(&state, tetlod_page_count(file, level));
            if (goes && tetlod_page_set_remove(set, level, page, NULL) == TETLOD_OK) {
                CHECK_INT(tetlod_page_set_remove(mirror, level, page, NULL), TETLOD_OK);
                gone++;
                break;
            }
            if (!goes && !tetlod_page_set_has(set, level, page)) {
                CHECK_INT(tetlod_page_set_add(set, level, page, NULL), TETLOD_OK);
                CHECK_INT(tetlod_page_set_add(mirror, level, page, NULL), TETLOD_OK);
                break;
            }
        }
        tetlod_page_set_info(set, &after);
        counted.reads = 0;
        CHECK_INT(tetlod_cursor_select(cursor, set, NULL), TETLOD_OK);
        enum tetlod_status status = TETLOD_MORE;
        while (step % 3 == 0 && (status = tetlod_cursor_step(cursor, after.level, 1, NULL)) == TETLOD_MORE)
            continue;
        CHECK_INT(step % 3 ? tetlod_cursor_seek(cursor, after.level, NULL) : status, TETLOD_OK);
        uint32_t more = after.pages > before.pages ? after.pages - before.pages : 0;
        CHECK(counted.reads <= more * (1 + info->field_count));
        struct tetlod_cursor *fresh = cursor_with(file, mirror);
        CHECK(same_all_the_way(cursor, fresh, &state));
        tetlod_cursor_free(fresh);
    }
    CHECK(gone > steps / 4);
    tetlod_cursor_free(cursor);
    tetlod_page_set_free(set);
    tetlod_page_set_free(mirror);
    tetlod_close(own);
}

/* Numbers are those of the whole level, and levels those up to which the whole has the same tetrahedra. */
static void test_numbers(void)
{
    uint32_t state = 3;
    for (int trial = 0; trial < 20; trial++) {
        struct tetlod_page_set *set = random_set(&state, 1 + chance(&state, 5));
        struct tetlod_cursor *some = cursor_with(file, set), *all;
        struct tetlod_mesh mesh, whole;
        REQUIRE(tetlod_cursor_new(&all, file, NULL, 0, NULL) == TETLOD_OK);
        tetlod_cursor_mesh(some, &mesh);
        uint32_t *numbers = malloc(mesh.vertices * sizeof *numbers), *tets = malloc(mesh.tets * sizeof *tets),
                 *levels = malloc(mesh.tets * sizeof *levels), found = 0;
        REQUIRE(numbers && tets && levels);
        tetlod_cursor_numbers(some, numbers, tets);
        tetlod_cursor_tet_levels(some, levels);
        for (uint32_t level = info->first_paged_level - 1; level <= finest(); level++) {
            CHECK_INT(tetlod_cursor_seek(all, level, NULL), TETLOD_OK);
            tetlod_cursor_mesh(all, &whole);
            for (uint32_t t = 0; t < mesh.tets; t++) {
                if (levels[t] != level)
                    continue;
                found++;
                for (int c = 0; c < 4; c++) {
                    uint32_t here = mesh.corners[4 * t + c], there = whole.corners[4 * (size_t)tets[t] + c];
                    CHECK_INT(numbers[here], there);
                    CHECK(memcmp(mesh.positions + 3 * here, whole.positions + 3 * there, 24) == 0);
                }
            }
        }
        CHECK_INT(found, mesh.tets);
        free(numbers);
        free(tets);
        free(levels);
        tetlod_cursor_free(some);
        tetlod_cursor_free(all);
        tetlod_page_set_free(set);
    }
}

/* The bytes of a set are those of its pages, each once. */
static void test_spans_of_pages(void)
{
    uint32_t state = 5, few[] = {0};
    for (int trial = 0; trial < 20; trial++) {
        const uint32_t *fields = trial % 2 ? few : NULL;
        struct tetlod_page_set *set = random_set(&state, 4);
        struct tetlod_span spans[400], own[8];
        size_t count = tetlod_page_set_spans(set, fields, fields != NULL, 0, spans, 400), held = 0, single = 0;
        for (size_t i = 0; i < count; i++)
            held += spans[i].size;
        for (uint32_t level = info->first_paged_level; level <= finest(); level++)
            for (uint32_t p = 0; p < tetlod_page_count(file, level); p++) {
                size_t parts = tetlod_page_spans(file, level, p, fields, fields != NULL, own, 8);
                CHECK(parts <= (fields ? 2 : 1 + (size_t)info->field_count));
                for (size_t i = 0; i < parts && tetlod_page_set_has(set, level, p); i++)
                    single += own[i].size;
            }
        CHECK(held > 0 && held == single);
        tetlod_page_set_free(set);
    }
    CHECK_INT(tetlod_page_spans(file, 0, 0, NULL, 0, NULL, 0), 0);
    CHECK_INT(tetlod_page_spans(file, finest(), tetlod_page_count(file, finest()), NULL, 0, NULL, 0), 0);
}

/* A stream of one of two fields as it arrives: cursors have each level as soon as its bytes are there. */
static void feed_field(struct tetlod_file *two, const uint8_t *all, uint32_t field)
{
    const struct tetlod_info *of = tetlod_info(two);
    struct tetlod_span spans[400];
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor = NULL, *whole;
    struct tetlod_mesh mesh, same;
    size_t count = tetlod_spans(two, TETLOD_NONE, of->level_count - 1, &field, 1, spans, 400);
    REQUIRE(count <= 400 && tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
    REQUIRE(tetlod_feed_select(feed, &of->fields[field].name, 1, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&whole, two, NULL, 0, NULL) == TETLOD_OK);
    uint32_t level = TETLOD_NONE, before;
    for (size_t i = 0; i < count; i++)
        for (uint64_t at = 0; at < spans[i].size; at += 97) {
            size_t some = spans[i].size - at < 97 ? (size_t)(spans[i].size - at) : 97;
            CHECK(tetlod_feed_add(feed, all + spans[i].offset + at, some, NULL) <= TETLOD_MORE);
            before = level;
            level = tetlod_feed_level(feed);
            if (level == before)
                continue;
            if (!cursor)
                REQUIRE(tetlod_cursor_new(&cursor, tetlod_feed_file(feed), &field, 1, NULL) == TETLOD_OK);
            CHECK_INT(tetlod_cursor_seek(cursor, level, NULL), TETLOD_OK);
            CHECK_INT(tetlod_cursor_seek(whole, level, NULL), TETLOD_OK);
            tetlod_cursor_mesh(cursor, &mesh);
            tetlod_cursor_mesh(whole, &same);
            CHECK(mesh.tets == same.tets && memcmp(mesh.corners, same.corners, 16 * (size_t)same.tets) == 0);
            CHECK(memcmp(mesh.fields[field], same.fields[field], 8 * (size_t)same.vertices) == 0);
        }
    CHECK_INT(level, of->level_count - 1);
    tetlod_cursor_free(cursor);
    tetlod_cursor_free(whole);
    tetlod_feed_free(feed);
}

/* Geometry and first field of a page are one range; neighbours are one range, too, for those who want no other field.
 */
static void test_fields_of_pages(void)
{
    struct tetlod_file *two;
    size_t count;
    uint8_t *all = read_golden("../../format/conformance/valid/paged_float64.tetlod", &count);
    REQUIRE(tetlod_open_memory(&two, all, count, NULL, NULL) == TETLOD_OK);
    const uint32_t level = tetlod_info(two)->first_paged_level, fields[] = {0, 1};
    struct tetlod_span spans[4], first, second;
    CHECK_INT(tetlod_page_spans(two, level, 0, fields, 1, &first, 1), 1);
    CHECK_INT(tetlod_page_spans(two, level, 1, fields, 1, &second, 1), 1);
    CHECK_INT(first.offset + first.size, second.offset);
    CHECK_INT(tetlod_page_spans(two, level, 0, fields + 1, 1, spans, 4), 2);
    CHECK_INT(tetlod_page_spans(two, level, 0, NULL, 0, spans, 4), 2);
    CHECK_INT(tetlod_spans(two, level - 1, level, fields, 1, spans, 4), 1);
    CHECK_INT(tetlod_spans(two, level - 1, level, NULL, 0, spans, 4), 1);
    for (uint32_t field = 0; field < 2; field++)
        feed_field(two, all, field);
    tetlod_close(two);
    free(all);
}

struct allowed {
    const struct tetlod_span *spans;
    size_t count;
};

static enum tetlod_status read_allowed(void *opaque, uint64_t offset, void *buffer, size_t length)
{
    const struct allowed *allowed = opaque;
    for (size_t i = 0; i < allowed->count; i++)
        if (offset >= allowed->spans[i].offset &&
            offset + length <= allowed->spans[i].offset + allowed->spans[i].size) {
            memcpy(buffer, bytes + offset, length);
            return TETLOD_OK;
        }
    return TETLOD_ERR_IO;
}

/* What the spans say is enough. */
static void test_spans(void)
{
    uint32_t state = 11, root = info->first_paged_level - 1;
    for (int trial = 0; trial < 20; trial++) {
        struct tetlod_page_set *set = random_set(&state, 1 + chance(&state, 3));
        struct tetlod_span spans[400];
        uint64_t gap = trial % 3 * 100, end = 0;
        size_t before = tetlod_spans(file, TETLOD_NONE, root, NULL, 0, spans, 400);
        size_t count = before + tetlod_page_set_spans(set, NULL, 0, gap, spans + before, 400 - before);
        CHECK(count <= 400 && tetlod_page_set_spans(set, NULL, 0, gap, NULL, 0) == count - before);
        for (size_t i = before; i < count; i++) {
            CHECK(i == before || spans[i].offset > end + gap);
            end = spans[i].offset + spans[i].size;
        }
        struct allowed allowed = {spans, count};
        struct tetlod_source source = {read_allowed, &allowed, size};
        struct tetlod_file *thin;
        REQUIRE(tetlod_open(&thin, &source, NULL, NULL) == TETLOD_OK);
        struct tetlod_cursor *cursor, *fresh = cursor_with(file, set);
        struct tetlod_page_set_info what;
        tetlod_page_set_info(set, &what);
        REQUIRE(tetlod_cursor_new(&cursor, thin, NULL, 0, NULL) == TETLOD_OK);
        CHECK_INT(tetlod_cursor_select(cursor, set, NULL), TETLOD_ERR_ARGUMENT); // another file's
        tetlod_cursor_free(cursor);
        struct tetlod_page_set *own;
        REQUIRE(tetlod_page_set_new(&own, thin, 0, NULL, 0, NULL) == TETLOD_OK);
        for (uint32_t level = info->first_paged_level; level <= finest(); level++)
            for (uint32_t p = 0; p < tetlod_page_count(file, level); p++)
                if (tetlod_page_set_has(set, level, p))
                    CHECK_INT(tetlod_page_set_add(own, level, p, NULL), TETLOD_OK);
        cursor = cursor_with(thin, own);
        CHECK(same(cursor, fresh));
        CHECK_INT(tetlod_cursor_select(cursor, NULL, NULL), TETLOD_OK); // what cannot be read can be asked for again
        CHECK_INT(tetlod_cursor_seek(cursor, finest(), NULL), TETLOD_ERR_IO);
        CHECK_INT(tetlod_cursor_seek(cursor, finest(), NULL), TETLOD_ERR_IO);
        CHECK_INT(tetlod_cursor_select(cursor, own, NULL), TETLOD_OK);
        CHECK_INT(tetlod_cursor_seek(cursor, what.level, NULL), TETLOD_OK);
        CHECK(same(cursor, fresh));
        tetlod_cursor_free(cursor);
        tetlod_cursor_free(fresh);
        tetlod_page_set_free(own);
        tetlod_page_set_free(set);
        tetlod_close(thin);
    }
}

/* Everything within a box, or a ball, is that of the level that is wanted there. */
static void test_places(void)
{
    uint32_t state = 5, inside = 0;
    for (int trial = 0; trial < 30; trial++) {
        uint32_t first = info->first_paged_level;
        struct tetlod_place place = {.level = first + chance(&state, finest() - first + 1)};
        double middle[3], half = 0.3 + 0.1 * chance(&state, 8);
        for (int axis = 0; axis < 3; axis++) {
            middle[axis] = place.low[axis] = chance(&state, 600) / 100.0;
            place.low[axis] -= trial % 2 ? half : 0;
            place.high[axis] = middle[axis] + half;
        }
        place.radius = trial % 2 ? 0 : half;
        struct tetlod_page_set *set;
        REQUIRE(tetlod_page_set_new(&set, file, 0, &place, 1, NULL) == TETLOD_OK);
        struct tetlod_cursor *cursor = cursor_with(file, set);
        struct tetlod_mesh mesh;
        tetlod_cursor_mesh(cursor, &mesh);
        uint32_t *levels = malloc(mesh.tets * sizeof *levels);
        REQUIRE(levels != NULL);
        tetlod_cursor_tet_levels(cursor, levels);
        for (uint32_t t = 0; t < mesh.tets; t++) {
            bool meets = false; // surely: a corner is in it
            for (int c = 0; c < 4; c++) {
                const double *p = mesh.positions + 3 * (size_t)mesh.corners[4 * t + c];
                double far = 0, squares = 0;
                for (int axis = 0; axis < 3; axis++) {
                    double gap = p[axis] > middle[axis] ? p[axis] - middle[axis] : middle[axis] - p[axis];
                    far = gap > far ? gap : far;
                    squares += gap * gap;
                }
                meets |= place.radius > 0 ? squares <= half * half : far <= half;
            }
            inside += meets;
            CHECK(!meets || levels[t] >= place.level);
        }
        free(levels);
        tetlod_cursor_free(cursor);
        tetlod_page_set_free(set);
    }
    CHECK(inside > 300);
}

/* On several threads all is as on one: sets, whole levels, the way back, and what damage leaves. */
static void test_threads(void)
{
    uint32_t state = 13;
    for (uint32_t threads = 2; threads <= 5; threads++) {
        struct tetlod_options options = {.struct_size = sizeof options, .threads = threads};
        struct tetlod_file *other;
        struct tetlod_cursor *alone, *together;
        REQUIRE(tetlod_open_memory(&other, bytes, size, &options, NULL) == TETLOD_OK);
        REQUIRE(tetlod_cursor_new(&alone, file, NULL, 0, NULL) == TETLOD_OK);
        REQUIRE(tetlod_cursor_new(&together, other, NULL, 0, NULL) == TETLOD_OK);
        for (int trial = 0; trial < 20; trial++) {
            uint32_t level = chance(&state, info->level_count), records = chance(&state, 300);
            if (trial % 4 == 1) { // other pages
                struct tetlod_page_set *set, *same_set;
                uint32_t from = info->first_paged_level + chance(&state, finest() - info->first_paged_level + 1);
                uint32_t page = chance(&state, tetlod_page_count(file, from));
                REQUIRE(tetlod_page_set_new(&set, file, 0, NULL, 0, NULL) == TETLOD_OK);
                REQUIRE(tetlod_page_set_new(&same_set, other, 0, NULL, 0, NULL) == TETLOD_OK);
                CHECK_INT(tetlod_page_set_add(set, from, page, NULL), TETLOD_OK);
                CHECK_INT(tetlod_page_set_add(same_set, from, page, NULL), TETLOD_OK);
                CHECK_INT(tetlod_cursor_select(alone, set, NULL), TETLOD_OK);
                CHECK_INT(tetlod_cursor_select(together, same_set, NULL), TETLOD_OK);
                CHECK(same(alone, together));
                tetlod_page_set_free(set);
                tetlod_page_set_free(same_set);
                level = from;
            } else if (trial % 4 == 3) {
                CHECK_INT(tetlod_cursor_select(alone, NULL, NULL), TETLOD_OK);
                CHECK_INT(tetlod_cursor_select(together, NULL, NULL), TETLOD_OK);
            } else if (trial % 4 == 2) {
                level = level < info->first_paged_level ? level : info->first_paged_level;
            }
            CHECK_INT(tetlod_cursor_seek(alone, level, NULL), tetlod_cursor_seek(together, level, NULL));
            CHECK(same(alone, together));
            enum tetlod_status a = tetlod_cursor_step(alone, 0, records, NULL);
            CHECK_INT(tetlod_cursor_step(together, 0, records, NULL), a);
            CHECK(same(alone, together));
            a = tetlod_cursor_step(alone, level, records / 2, NULL);
            CHECK_INT(tetlod_cursor_step(together, level, records / 2, NULL), a);
            CHECK(same(alone, together));
        }
        tetlod_cursor_free(alone);
        tetlod_cursor_free(together);
        tetlod_close(other);
    }
}

/* A damaged page: the same failure on any number of threads, and the level before it is whole. */
static void test_damage(void)
{
    uint32_t state = 17;
    for (int trial = 0; trial < 24; trial++) {
        uint32_t level = info->first_paged_level + chance(&state, finest() - info->first_paged_level + 1);
        uint64_t from = info->levels[level].offset, length = info->levels[level].end - from;
        uint64_t at = from + chance(&state, (uint32_t)length);
        struct tetlod_error errors[2] = {{0}};
        struct tetlod_cursor *cursors[2];
        struct tetlod_file *files[2];
        bytes[at] ^= 4;
        for (uint32_t i = 0; i < 2; i++) {
            struct tetlod_options options = {.struct_size = sizeof options, .threads = 1 + 2 * i};
            REQUIRE(tetlod_open_memory(&files[i], bytes, size, &options, NULL) == TETLOD_OK);
            REQUIRE(tetlod_cursor_new(&cursors[i], files[i], NULL, 0, NULL) == TETLOD_OK);
            CHECK_INT(tetlod_cursor_seek(cursors[i], finest(), &errors[i]), TETLOD_ERR_CHECKSUM);
        }
        CHECK_TEXT(errors[0].message, errors[1].message);
        CHECK(same(cursors[0], cursors[1]));
        struct tetlod_mesh whole;
        tetlod_cursor_mesh(cursors[0], &whole); // whatever is decoded with it
        CHECK_INT(whole.level, level - 1);
        CHECK_INT(whole.tets, info->levels[level - 1].tets);
        bytes[at] ^= 4;
        for (int i = 0; i < 2; i++)
            CHECK_INT(tetlod_cursor_seek(cursors[i], finest(), NULL), TETLOD_OK); // it was written anew
        CHECK(same(cursors[0], cursors[1]));
        for (int i = 0; i < 2; i++) {
            CHECK_INT(tetlod_cursor_seek(cursors[i], 0, NULL), TETLOD_OK);
            tetlod_cursor_free(cursors[i]);
            tetlod_close(files[i]);
        }
    }
}

/* A reader of all pages takes tetrahedra that leave their page: the mesh is the same. */
static void test_leaving(void)
{
    struct tetlod_options options = {.struct_size = sizeof options, .threads = 2};
    struct tetlod_file *other;
    struct tetlod_cursor *here, *there;
    size_t other_size;
    uint8_t *other_bytes = read_golden("invalid/paged_leaves.tetlod", &other_size);
    REQUIRE(tetlod_open_memory(&other, other_bytes, other_size, &options, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&here, file, NULL, 0, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&there, other, NULL, 0, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(here, finest(), NULL), TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(there, finest(), NULL), TETLOD_OK);
    CHECK(same(here, there));
    tetlod_cursor_free(here);
    tetlod_cursor_free(there);
    tetlod_close(other);
    free(other_bytes);
}

/* A limit of exactly a set's memory is enough to decode it and to move down and up; with one byte less it is refused
 * before anything is decoded. The set that is made for some memory is as fine as the memory allows. */
static void test_memory(void)
{
    for (int eighths = 1; eighths <= 8; eighths++) {
        struct tetlod_place place = {.level = finest()};
        struct tetlod_page_set_info about, less;
        struct tetlod_page_set *set, *small;
        struct tetlod_error error = {0};
        uint32_t level;
        for (int axis = 0; axis < 3; axis++) {
            double width = info->bounds[1][axis] - info->bounds[0][axis];
            place.low[axis] = info->bounds[0][axis];
            place.high[axis] = place.low[axis] + width * eighths / 8;
        }
        REQUIRE(tetlod_page_set_new(&set, file, 0, &place, 1, NULL) == TETLOD_OK);
        tetlod_page_set_info(set, &about);
        tetlod_page_set_free(set);
        for (int enough = 0; enough < 2; enough++) {
            struct tetlod_options options = {.struct_size = sizeof options, .max_bytes = about.memory - !enough};
            struct tetlod_file *other;
            struct tetlod_cursor *cursor;
            struct tetlod_mesh mesh;
            REQUIRE(tetlod_open_memory(&other, bytes, size, &options, NULL) == TETLOD_OK);
            REQUIRE(tetlod_page_set_new(&set, other, 0, &place, 1, NULL) == TETLOD_OK);
            REQUIRE(tetlod_cursor_new(&cursor, other, NULL, 0, NULL) == TETLOD_OK);
            CHECK_INT(tetlod_cursor_select(cursor, set, &error), enough ? TETLOD_OK : TETLOD_ERR_LIMIT);
            CHECK_INT(tetlod_cursor_seek(cursor, enough ? about.level : info->first_paged_level - 1, NULL), TETLOD_OK);
            CHECK_INT(tetlod_cursor_seek(cursor, 0, NULL), TETLOD_OK);
            CHECK_INT(tetlod_cursor_seek(cursor, enough ? about.level : info->first_paged_level - 1, NULL), TETLOD_OK);
            tetlod_cursor_mesh(cursor, &mesh);
            CHECK_INT(mesh.tets, enough ? about.tets : info->levels[info->first_paged_level - 1].tets);
            tetlod_cursor_free(cursor);
            tetlod_page_set_free(set);
            tetlod_close(other);
        }
        char needed[32];
        snprintf(needed, sizeof needed, " %llu ", (unsigned long long)about.memory);
        CHECK(strstr(error.message, needed) != NULL);
        REQUIRE(tetlod_page_set_fit(&set, file, 0, &place, 1, about.memory, &level, NULL) == TETLOD_OK);
        REQUIRE(tetlod_page_set_fit(&small, file, 0, &place, 1, about.memory - 1, &level, NULL) == TETLOD_OK);
        tetlod_page_set_info(set, &less);
        CHECK_INT(less.tets, about.tets);
        tetlod_page_set_info(small, &less);
        CHECK(level < finest() && less.memory < about.memory && less.tets < about.tets);
        tetlod_page_set_free(set);
        place.level = level + 1; // the next finer one is too much
        REQUIRE(tetlod_page_set_new(&set, file, 0, &place, 1, NULL) == TETLOD_OK);
        tetlod_page_set_info(set, &less);
        CHECK(less.memory >= about.memory);
        tetlod_page_set_free(set);
        tetlod_page_set_free(small);
        CHECK_INT(tetlod_page_set_fit(&set, file, 0, &place, 1, 1000, &level, &error), TETLOD_ERR_LIMIT);
        CHECK(set == NULL);
    }
}

static void test_refusals(void)
{
    struct tetlod_page_set *set;
    struct tetlod_place exact = {.level = info->level_count - 1};
    struct tetlod_cursor *cursor;
    CHECK_INT(tetlod_page_set_new(&set, file, 0, &exact, 1, NULL), TETLOD_ERR_ARGUMENT);
    CHECK_INT(tetlod_page_set_new(&set, file, info->level_count, NULL, 0, NULL), TETLOD_ERR_ARGUMENT);
    REQUIRE(tetlod_page_set_new(&set, file, 0, NULL, 0, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_page_set_add(set, 1, 0, NULL), TETLOD_ERR_ARGUMENT);
    CHECK_INT(tetlod_page_set_add(set, finest(), 100000, NULL), TETLOD_ERR_ARGUMENT);
    CHECK_INT(tetlod_page_set_remove(set, finest(), 0, NULL), TETLOD_ERR_ARGUMENT);
    cursor = cursor_with(file, set);
    CHECK_INT(tetlod_cursor_seek(cursor, finest(), NULL), TETLOD_ERR_ARGUMENT);
    CHECK_INT(tetlod_cursor_add_field(cursor, 5, NULL), TETLOD_ERR_ARGUMENT);
    tetlod_cursor_free(cursor);
    tetlod_page_set_free(set);
}

int main(void)
{
    open_stream();
    RUN(test_closed);
    RUN(test_moves);
    RUN(test_walk);
    RUN(test_numbers);
    RUN(test_spans);
    RUN(test_spans_of_pages);
    RUN(test_fields_of_pages);
    RUN(test_places);
    RUN(test_threads);
    RUN(test_damage);
    RUN(test_leaving);
    RUN(test_memory);
    RUN(test_refusals);
    tetlod_close(file);
    free(bytes);
    return test_end();
}
