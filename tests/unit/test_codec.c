/* SPDX-License-Identifier: BSD-3-Clause */
/* Any contraction sequence over any complex comes back: every level as the forest says, every record both ways. */
#include <stdlib.h>
#include <string.h>

#include "format/common/allowance.h"
#include "format/read/cursor.h"
#include "format/fail.h"
#include "format/read/reader.h"
#include "format/write/writer.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

struct stream {
    struct recode recode;
    struct memory_sink memory;
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
};

static int stream_open(struct stream *s, const struct gen_options *options)
{
    struct tetlod_error error = {0};
    *s = (struct stream){0};
    struct tetlodi_sink sink = memory_sink(&s->memory);
    CHECK(gen_make(&s->recode, options));
    if (tetlodi_write(&s->recode.input, &sink, &error) != TETLOD_OK ||
        tetlod_open_memory(&s->file, s->memory.bytes, s->memory.size, NULL, &error) != TETLOD_OK ||
        tetlod_cursor_new(&s->cursor, s->file, NULL, 0, &error) != TETLOD_OK)
        TEST_FAIL("kind %d, seed %d: %s", (int)options->kind, (int)options->seed, error.message);
    return s->cursor != NULL;
}

static void stream_close(struct stream *s)
{
    tetlod_cursor_free(s->cursor);
    tetlod_close(s->file);
    free(s->memory.bytes);
    gen_free(&s->recode);
}

static uint64_t hash(uint64_t h, const void *bytes, size_t size)
{
    const unsigned char *p = bytes;
    for (size_t i = 0; i < size; i++)
        h = (h ^ p[i]) * UINT64_C(1099511628211);
    return h;
}

static uint64_t state_of(const struct stream *s)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(s->cursor, &mesh);
    uint64_t h = hash(mesh.tets, mesh.positions, mesh.vertices * 24ul);
    h = hash(h, mesh.corners, mesh.tets * 16ul);
    h = hash(h, mesh.parents, mesh.vertices * 4ul);
    h = hash(h, mesh.fields[0], mesh.vertices * 8ul);
    return hash(h, mesh.fields[1], mesh.vertices * 16ul);
}

/* Corners in ascending order, and whether that took an odd permutation. */
static void normalise(const uint32_t in[4], uint32_t out[5])
{
    memcpy(out, in, 16);
    out[4] = 0;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 3; j++)
            if (out[j] > out[j + 1]) {
                uint32_t swap = out[j];
                out[j] = out[j + 1];
                out[j + 1] = swap;
                out[4] ^= 1;
            }
}

static int compare(const void *a, const void *b)
{
    return memcmp(a, b, 20);
}

static uint32_t living(const struct tetlodi_write_input *input, const uint32_t *parent, uint32_t done, uint32_t node)
{
    while (parent[node] < input->vertices + done)
        node = parent[node];
    return node;
}

/* Are these a node's values? The exact tail has others for the original's vertices. */
static int has_values(const struct tetlodi_write_field *field, const double *values, uint32_t leaf, uint32_t i,
                      int last)
{
    const double *originals = last && field->exact ? field->exact : field->values;
    return memcmp(values, (leaf ? originals : field->node_values) + field->components * (size_t)i,
                  field->components * sizeof *values) == 0;
}

/* The current level against the forest: vertices, numbers, tetrahedra with their orientation. */
static void check_level(const struct stream *s, uint32_t level, const uint32_t *parent)
{
    const struct tetlodi_write_input *in = &s->recode.input;
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(s->cursor, &mesh);
    uint32_t done = in->levels[level].contractions, count = 0, wrong = 0;
    uint32_t(*wanted)[5] = malloc(in->tets * sizeof *wanted), (*got)[5] = malloc(in->tets * sizeof *got);
    CHECK_INT(mesh.level, level);
    for (uint32_t t = 0; t < in->tets; t++) {
        uint32_t corners[4];
        for (int c = 0; c < 4; c++)
            corners[c] = living(in, parent, done, in->corners[4 * t + (uint32_t)c]);
        normalise(corners, wanted[count]);
        const uint32_t *w = wanted[count];
        count += w[0] != w[1] && w[1] != w[2] && w[2] != w[3];
    }
    CHECK_INT(mesh.tets, count);
    for (uint32_t t = 0; t < mesh.tets && mesh.tets == count; t++) {
        uint32_t corners[4];
        for (int c = 0; c < 4; c++)
            corners[c] = (uint32_t)mesh.fields[0][mesh.corners[4 * t + (uint32_t)c]];
        normalise(corners, got[t]);
    }
    qsort(wanted, count, sizeof *wanted, compare);
    if (mesh.tets == count) {
        qsort(got, count, sizeof *got, compare);
        CHECK_INT(memcmp(got, wanted, count * sizeof *got), 0);
    }
    for (uint32_t v = 0; v < mesh.vertices; v++) {
        uint32_t node = (uint32_t)mesh.fields[0][v], leaf = node < in->vertices, i = leaf ? node : node - in->vertices;
        wrong += living(in, parent, done, node) != node;
        wrong += memcmp(mesh.positions + 3 * v, (leaf ? in->positions : in->node_positions) + 3 * i, 24) != 0;
        for (uint32_t f = 1; f < in->field_count; f++)
            wrong += !has_values(&in->fields[f], mesh.fields[f] + in->fields[f].components * v, leaf, i,
                                 level + 1 == in->level_count);
    }
    CHECK_INT(wrong, 0);
    free(wanted);
    free(got);
}

static void check_levels(struct stream *s)
{
    const struct tetlodi_write_input *in = &s->recode.input;
    uint32_t nodes = in->vertices + in->contractions, *parent = malloc(nodes * sizeof *parent);
    struct tetlod_error error = {0};
    memset(parent, 0xff, nodes * sizeof *parent);
    for (uint32_t c = 0; c < in->contractions; c++)
        for (uint32_t i = 0; i < 4; i++)
            if (in->children[4 * c + i] != TETLOD_NONE)
                parent[in->children[4 * c + i]] = in->vertices + c;
    for (uint32_t k = 0; k < in->level_count; k++) {
        CHECK_INT(tetlod_cursor_seek(s->cursor, k, &error), TETLOD_OK);
        check_level(s, k, parent);
    }
    free(parent);
}

/* Record by record down, up again and down, with the same states; and the same from a cursor that has not been up. */
static void check_records(struct stream *s)
{
    uint32_t contractions = s->recode.input.contractions, n = 0, wrong = 0;
    if (s->recode.input.field_count > 2) // the exact tail is a step as well
        contractions++;
    uint64_t *states = malloc((contractions + 1ul) * sizeof *states);
    struct tetlod_cursor *first = s->cursor;
    do
        states[n++] = state_of(s);
    while (n <= contractions && tetlod_cursor_coarsen(s->cursor, NULL) == TETLOD_OK);
    CHECK_INT(n, contractions + 1);
    CHECK_INT(tetlod_cursor_coarsen(s->cursor, NULL), TETLOD_END);
    for (uint32_t i = n - 1; i-- > 0;)
        wrong += tetlod_cursor_refine(s->cursor, NULL) != TETLOD_OK || state_of(s) != states[i];
    CHECK_INT(tetlod_cursor_refine(s->cursor, NULL), TETLOD_END);
    CHECK_INT(tetlod_cursor_seek(s->cursor, 0, NULL), TETLOD_OK);
    wrong += state_of(s) != states[n - 1];
    CHECK_INT(tetlod_cursor_new(&s->cursor, s->file, NULL, 0, NULL), TETLOD_OK);
    for (uint32_t i = n - 1; i-- > 0;)
        wrong += tetlod_cursor_refine(s->cursor, NULL) != TETLOD_OK || state_of(s) != states[i];
    CHECK_INT(wrong, 0);
    tetlod_cursor_free(first);
    free(states);
}

static void round_trip(enum gen_kind kind, unsigned arity, enum tetlod_type type, unsigned bits, int tail)
{
    for (uint64_t seed = 1; seed <= 12 && !test_failed_here; seed++) {
        struct stream s;
        struct gen_options options = {kind, seed, 1 + (uint32_t)seed % 4, 1 + (uint32_t)seed * 3 % 8, arity, type, bits,
                                      (unsigned)(tail ? 1 + seed * 3 % 30 : 0), tail > 1};
        if (stream_open(&s, &options)) {
            check_levels(&s);
            check_records(&s);
        }
        stream_close(&s);
        if (test_failed_here)
            printf("# kind %d, seed %d\n", (int)kind, (int)seed);
    }
}

static void test_grids(void)
{
    round_trip(GEN_GRID, 2, TETLOD_FLOAT32, 0, 0);
}

static void test_grids_of_float64(void)
{
    round_trip(GEN_GRID, 3, TETLOD_FLOAT64, 0, 0);
}

static void test_grids_with_holes(void)
{
    round_trip(GEN_HOLES, 4, TETLOD_FLOAT32, 0, 0);
}

static void test_soups(void)
{
    round_trip(GEN_SOUP, 4, TETLOD_FLOAT64, 0, 0);
}

static void test_exact_tails(void)
{
    round_trip(GEN_GRID, 2, TETLOD_FLOAT32, 0, 1);
    round_trip(GEN_HOLES, 4, TETLOD_FLOAT64, 0, 1);
    round_trip(GEN_SOUP, 3, TETLOD_FLOAT64, 16, 1);
    round_trip(GEN_GRID, 3, TETLOD_FLOAT64, 16, 2);
}

/* Links of more vertices than there is a table of pairs for. */
static void test_large_links(void)
{
    struct stream s;
    struct gen_options options = {GEN_HUB, 1, 7, 5, 2, TETLOD_FLOAT32, 16, 0, 0};
    if (stream_open(&s, &options)) {
        CHECK(s.recode.input.tets > 500);
        check_levels(&s);
        check_records(&s);
    }
    stream_close(&s);
}

static void test_quantised(void)
{
    round_trip(GEN_GRID, 2, TETLOD_FLOAT32, 12, 0);
    round_trip(GEN_SOUP, 4, TETLOD_FLOAT64, 30, 0);
}

static void test_selected_fields(void)
{
    struct stream s;
    struct gen_options options = {GEN_HOLES, 5, 3, 6, 2, TETLOD_FLOAT32, 0, 0, 0};
    REQUIRE(stream_open(&s, &options));
    struct tetlod_cursor *cursor;
    struct tetlod_mesh some, all;
    uint32_t finest = tetlod_info(s.file)->level_count - 1;
    REQUIRE(tetlod_cursor_new(&cursor, s.file, (uint32_t[]){1}, 1, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(cursor, finest, NULL), TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(s.cursor, finest, NULL), TETLOD_OK);
    tetlod_cursor_mesh(cursor, &some);
    tetlod_cursor_mesh(s.cursor, &all);
    CHECK(some.fields[0] == NULL);
    CHECK_INT(some.tets, all.tets);
    CHECK_INT(memcmp(some.corners, all.corners, all.tets * 16ul), 0);
    CHECK_INT(memcmp(some.fields[1], all.fields[1], all.vertices * 16ul), 0);
    tetlod_cursor_free(cursor);
    stream_close(&s);
}

static void test_origins(void)
{
    struct stream s;
    struct gen_options options = {GEN_GRID, 8, 4, 8, 4, TETLOD_FLOAT32, 0, 0, 0};
    REQUIRE(stream_open(&s, &options));
    struct tetlod_mesh mesh;
    double coarse[3 * 125], ids[125], origins[3 * 125], origin_ids[125], *fields[2] = {origin_ids, NULL};
    uint32_t finest = tetlod_info(s.file)->level_count - 1;
    for (uint32_t low = 0; low <= finest; low++) {
        uint32_t wrong = 0;
        CHECK_INT(tetlod_cursor_seek(s.cursor, low, NULL), TETLOD_OK);
        tetlod_cursor_mesh(s.cursor, &mesh);
        uint32_t count = mesh.vertices;
        memcpy(coarse, mesh.positions, count * 24ul);
        memcpy(ids, mesh.fields[0], count * 8ul);
        CHECK_INT(tetlod_cursor_seek(s.cursor, finest, NULL), TETLOD_OK);
        CHECK_INT(tetlod_cursor_origins(s.cursor, low, origins, fields, NULL), TETLOD_OK);
        tetlod_cursor_mesh(s.cursor, &mesh);
        for (uint32_t v = 0; v < mesh.vertices; v++) {
            uint32_t ancestor = v;
            while (ancestor >= count)
                ancestor = mesh.parents[ancestor];
            wrong += memcmp(origins + 3 * v, coarse + 3 * ancestor, 24) != 0 || origin_ids[v] != ids[ancestor];
        }
        CHECK_INT(wrong, 0);
    }
    CHECK_INT(tetlod_cursor_seek(s.cursor, 0, NULL), TETLOD_OK);
    CHECK_INT(tetlod_cursor_origins(s.cursor, 1, origins, NULL, NULL), TETLOD_ERR_ARGUMENT);
    stream_close(&s);
}

/* The stream without the frames of all fields but one, as a server sends it. */
static struct tetlodi_buffer frames_of(const struct stream *s, uint32_t field)
{
    const struct tetlodi_index *index = &s->file->index;
    uint32_t parts = 1 + index->info.field_count;
    struct tetlodi_buffer out = {0};
    tetlodi_put_block(&out, s->memory.bytes, (size_t)index->info.levels[0].offset);
    for (uint32_t i = 0; i < index->info.level_count * parts; i++)
        if (i % parts == 0 || i % parts == 1 + field)
            tetlodi_put_block(&out, s->memory.bytes + index->frames[i].offset, index->frames[i].size);
    return out;
}

/* What is selected decodes as from the whole stream, as soon as its own bytes are there. */
static void test_feed_of_one_field(void)
{
    struct stream s;
    struct gen_options options = {GEN_HOLES, 6, 3, 6, 3, TETLOD_FLOAT64, 0, 0, 0};
    REQUIRE(stream_open(&s, &options));
    const struct tetlod_info *info = tetlod_info(s.file);
    REQUIRE(info->field_count > 1);
    for (uint32_t field = 0; field < info->field_count; field++)
        for (size_t piece = 1; piece < 4000; piece = piece * 3 + 1) {
            struct tetlodi_buffer part = frames_of(&s, field);
            struct tetlod_feed *feed;
            struct tetlod_cursor *cursor = NULL;
            struct tetlod_error error = {0};
            struct tetlod_mesh mesh, whole;
            uint32_t wrong = 0, level = TETLOD_NONE;
            REQUIRE(!part.failed && part.size < s.memory.size && tetlod_feed_new(&feed, NULL, &error) == TETLOD_OK);
            REQUIRE(tetlod_feed_select(feed, &info->fields[field].name, 1, &error) == TETLOD_OK);
            for (size_t at = 0; at < part.size; at += piece) {
                size_t size = part.size - at < piece ? part.size - at : piece;
                wrong += tetlod_feed_add(feed, part.bytes + at, size, &error) > TETLOD_MORE;
                level = tetlod_feed_level(feed);
                if (level == TETLOD_NONE)
                    continue;
                wrong += tetlod_feed_bytes(feed, level) > at + size;
                wrong += level + 1 < info->level_count && tetlod_feed_bytes(feed, level + 1) <= at + size;
                if (!cursor)
                    wrong += tetlod_cursor_new(&cursor, tetlod_feed_file(feed), &field, 1, &error) != TETLOD_OK;
                wrong += tetlod_cursor_seek(cursor, level, &error) != TETLOD_OK;
            }
            CHECK_INT(level, info->level_count - 1);
            CHECK_INT(wrong, 0);
            CHECK_INT(tetlod_feed_bytes(feed, level), part.size);
            REQUIRE(cursor && tetlod_cursor_seek(s.cursor, level, &error) == TETLOD_OK);
            tetlod_cursor_mesh(cursor, &mesh);
            tetlod_cursor_mesh(s.cursor, &whole);
            CHECK(memcmp(mesh.corners, whole.corners, 16 * (size_t)whole.tets) == 0);
            CHECK(memcmp(mesh.fields[field], whole.fields[field],
                         8 * (size_t)whole.vertices * info->fields[field].components) == 0);
            tetlod_cursor_free(cursor);
            tetlod_feed_free(feed);
            tetlodi_buffer_fini(&part);
        }
    /* What is left out takes no memory, and says what it is. */
    struct tetlod_feed *feed;
    struct tetlod_error error;
    struct tetlod_cursor *cursor;
    struct tetlodi_buffer part = frames_of(&s, 0);
    const struct tetlod_options narrow = {.struct_size = sizeof narrow, .max_bytes = part.size};
    const uint32_t other = 1;
    REQUIRE(tetlod_feed_new(&feed, &narrow, NULL) == TETLOD_OK);
    REQUIRE(tetlod_feed_select(feed, &info->fields[0].name, 1, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_feed_add(feed, part.bytes, part.size, &error), TETLOD_OK);
    CHECK_INT(tetlod_cursor_new(&cursor, tetlod_feed_file(feed), &other, 1, &error), TETLOD_ERR_LIMIT);
    tetlod_feed_free(feed);
    REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
    REQUIRE(tetlod_feed_select(feed, &info->fields[0].name, 1, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_feed_add(feed, part.bytes, part.size, &error), TETLOD_OK);
    CHECK_INT(tetlod_cursor_new(&cursor, tetlod_feed_file(feed), &other, 1, &error), TETLOD_ERR_FIELD);
    tetlod_feed_free(feed);
    tetlodi_buffer_fini(&part);
    const char *none = "nothing";
    REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK && tetlod_feed_select(feed, &none, 1, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_feed_add(feed, s.memory.bytes, s.memory.size, &error), TETLOD_ERR_FIELD);
    CHECK_INT(tetlod_feed_add(feed, s.memory.bytes, 1, &error), TETLOD_ERR_FIELD);
    CHECK(!tetlod_feed_file(feed));
    tetlod_feed_free(feed);
    stream_close(&s);
}

/* Fed in pieces of any size: each level can be had as soon as its last byte is there, and not before. */
static void test_feed(void)
{
    struct stream s;
    struct gen_options options = {GEN_HOLES, 6, 3, 6, 3, TETLOD_FLOAT64, 0, 0, 0};
    REQUIRE(stream_open(&s, &options));
    for (size_t piece = 1; piece < 4000; piece = piece * 3 + 1) {
        struct tetlod_feed *feed;
        struct tetlod_cursor *cursor = NULL;
        struct tetlod_error error = {0};
        uint32_t wrong = 0, level = TETLOD_NONE;
        REQUIRE(tetlod_feed_new(&feed, NULL, &error) == TETLOD_OK);
        for (size_t at = 0; at < s.memory.size; at += piece) {
            size_t size = s.memory.size - at < piece ? s.memory.size - at : piece;
            enum tetlod_status status = tetlod_feed_add(feed, s.memory.bytes + at, size, &error);
            const struct tetlod_info *info = tetlod_feed_file(feed) ? tetlod_info(tetlod_feed_file(feed)) : NULL;
            wrong += status != (info ? TETLOD_OK : TETLOD_MORE);
            level = tetlod_feed_level(feed);
            if (level == TETLOD_NONE)
                continue;
            if (!cursor)
                wrong += tetlod_cursor_new(&cursor, tetlod_feed_file(feed), NULL, 0, &error) != TETLOD_OK;
            wrong += tetlod_cursor_seek(cursor, level, &error) != TETLOD_OK;
            if (level + 1 < info->level_count)
                wrong += tetlod_cursor_seek(cursor, level + 1, &error) != TETLOD_ERR_TRUNCATED;
        }
        CHECK_INT(level, tetlod_info(s.file)->level_count - 1);
        CHECK_INT(wrong, 0);
        tetlod_cursor_free(cursor);
        tetlod_feed_free(feed);
    }
    struct tetlod_feed *feed;
    REQUIRE(tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
    char text[80] = "<html>";
    CHECK_INT(tetlod_feed_add(feed, text, sizeof text, NULL), TETLOD_ERR_NOT_TETLOD);
    tetlod_feed_free(feed);
    stream_close(&s);
}

/* A prefix gives every level that it holds whole. */
static void test_truncated(void)
{
    struct stream s;
    struct gen_options options = {GEN_HOLES, 7, 2, 5, 2, TETLOD_FLOAT32, 0, 0, 0};
    REQUIRE(stream_open(&s, &options));
    const struct tetlod_info *info = tetlod_info(s.file);
    for (size_t size = 0; size < s.memory.size; size++) {
        unsigned char *part = malloc(size + 1);
        struct tetlod_file *file;
        struct tetlod_cursor *cursor;
        struct tetlod_error error = {0};
        memcpy(part, s.memory.bytes, size);
        if (tetlod_open_memory(&file, part, size, NULL, &error) == TETLOD_OK) {
            enum tetlod_status status = tetlod_cursor_new(&cursor, file, NULL, 0, &error);
            CHECK_INT(status, size < info->levels[0].end ? TETLOD_ERR_TRUNCATED : TETLOD_OK);
            for (uint32_t k = 0; k < info->level_count && status == TETLOD_OK; k++) {
                enum tetlod_status there = size < info->levels[k].end ? TETLOD_ERR_TRUNCATED : TETLOD_OK;
                CHECK_INT(tetlod_cursor_seek(cursor, k, &error), there);
            }
            if (status == TETLOD_OK)
                tetlod_cursor_free(cursor);
            tetlod_close(file);
        } else {
            CHECK(size < info->levels[0].offset);
            CHECK(error.message[0]);
        }
        free(part);
    }
    stream_close(&s);
}

/* Every single byte that is changed is noticed: all bytes are under a checksum. */
static void test_damaged(void)
{
    struct stream s;
    struct gen_options options = {GEN_GRID, 9, 2, 4, 3, TETLOD_FLOAT32, 0, 0, 0};
    REQUIRE(stream_open(&s, &options));
    uint32_t finest = tetlod_info(s.file)->level_count - 1, unnoticed = 0;
    for (size_t i = 0; i < s.memory.size; i++) {
        struct tetlod_file *file;
        struct tetlod_cursor *cursor = NULL;
        struct tetlod_error error = {0};
        s.memory.bytes[i] ^= (unsigned char)(1u << i % 8);
        enum tetlod_status status = tetlod_open_memory(&file, s.memory.bytes, s.memory.size, NULL, &error);
        if (status == TETLOD_OK)
            status = tetlod_cursor_new(&cursor, file, NULL, 0, &error);
        if (status == TETLOD_OK)
            status = tetlod_cursor_seek(cursor, finest, &error);
        unnoticed += status == TETLOD_OK || !error.message[0];
        tetlod_cursor_free(cursor);
        tetlod_close(file);
        s.memory.bytes[i] ^= (unsigned char)(1u << i % 8);
    }
    CHECK_INT(unnoticed, 0);
    stream_close(&s);
}

/* Records that split large stars, one after the other, have frames with the bytes that their labels ask for; with more
 * labels than go with its bytes a level is refused. */
static void test_labels_go_with_bytes(void)
{
    struct gen_options options = {GEN_HUB, 1, 13, 5, 2, TETLOD_FLOAT32, 16, 0, 0};
    struct stream s;
    struct tetlod_error error = {0};
    if (stream_open(&s, &options)) {
        uint32_t last = tetlod_info(s.file)->level_count - 1;
        const struct tetlodi_recorder *recorder = &s.cursor->recorder;
        CHECK_INT(tetlod_cursor_seek(s.cursor, last, &error), TETLOD_OK);
        CHECK(recorder->labels > 2 * LABELS_FREE);
        for (uint32_t c = 0; c < s.cursor->replay.column_count; c++)
            CHECK(tetlodi_labels_hold(recorder, recorder->labels, c, s.cursor->columns[c].frame_bytes));
        tetlod_cursor_free(s.cursor);
        REQUIRE(tetlod_cursor_new(&s.cursor, s.file, NULL, 0, &error) == TETLOD_OK);
        uint64_t most = LABELS_FREE;
        for (uint32_t k = 0; k <= 1; k++)
            most += LABELS_PER_BYTE * s.file->index.frames[k * (1 + s.recode.input.field_count)].size;
        s.cursor->recorder.labels = most;
        CHECK_INT(tetlod_cursor_seek(s.cursor, 1, &error), TETLOD_ERR_STREAM);
        CHECK(strstr(error.message, "larger stars than go with its bytes") != NULL);
    }
    stream_close(&s);
}

static void test_sequences_that_are_none(void)
{
    struct recode recode;
    struct gen_options options = {GEN_GRID, 3, 2, 3, 2, TETLOD_FLOAT32, 0, 0, 0};
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct tetlod_error error;
    REQUIRE(gen_make(&recode, &options));
    uint32_t children[4 * 27], corners[4 * 48];
    memcpy(children, recode.input.children, 16 * recode.input.contractions);
    memcpy(corners, recode.input.corners, 16 * recode.input.tets);
    const uint32_t *good_children = recode.input.children, *good_corners = recode.input.corners;
    recode.input.children = children;
    children[4] = children[0];
    CHECK_INT(tetlodi_write(&recode.input, &sink, &error), TETLOD_ERR_ARGUMENT);
    recode.input.children = good_children;
    recode.input.corners = corners;
    corners[1] = corners[0];
    CHECK_INT(tetlodi_write(&recode.input, &sink, &error), TETLOD_ERR_ARGUMENT);
    corners[1] = 27;
    CHECK_INT(tetlodi_write(&recode.input, &sink, &error), TETLOD_ERR_ARGUMENT);
    recode.input.corners = good_corners;
    struct tetlodi_write_field fields[2];
    memcpy(fields, recode.input.fields, recode.input.field_count * sizeof *fields);
    recode.input.fields = fields;
    const char *const no_names[] = {"", "a\nb", "\xff", "\xc2\x85", "caf\xc3"}, *good_name = fields[0].name;
    for (size_t i = 0; i < sizeof no_names / sizeof *no_names; i++) {
        fields[0].name = no_names[i];
        CHECK_INT(tetlodi_write(&recode.input, &sink, &error), TETLOD_ERR_ARGUMENT);
    }
    fields[0].name = good_name;
    recode.levels[1].contractions = recode.levels[0].contractions;
    CHECK_INT(tetlodi_write(&recode.input, &sink, &error), TETLOD_ERR_ARGUMENT);
    CHECK_INT(memory.size, 0);
    free(memory.bytes);
    gen_free(&recode);
}

int main(void)
{
    RUN(test_grids);
    RUN(test_grids_of_float64);
    RUN(test_grids_with_holes);
    RUN(test_soups);
    RUN(test_large_links);
    RUN(test_quantised);
    RUN(test_exact_tails);
    RUN(test_selected_fields);
    RUN(test_origins);
    RUN(test_feed);
    RUN(test_feed_of_one_field);
    RUN(test_truncated);
    RUN(test_damaged);
    RUN(test_labels_go_with_bytes);
    RUN(test_sequences_that_are_none);
    return test_end();
}
