/* SPDX-License-Identifier: BSD-3-Clause */
/* Pages of changed bytes whose digests are right, so that they are decoded: on one thread and on several they fail
 * alike, to the word, or give the same mesh, also when they go on to other pages, and nothing that a sanitizer sees.
 * $MUTATIONS says how many, $SEED which, $STREAM of which stream. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "format/read/reader.h"
#include "tests/test.h"

enum { FILES = 3, PAGES = 6, MAX_CHANGES = 4 };

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { MUTATIONS = 50 }; // each takes ten times as long
#else
enum { MUTATIONS = 500 };
#endif

static uint8_t *bytes;
static size_t size;
static struct tetlod_file *files[FILES]; /* on 1, 2 and 4 threads */
static struct tetlod_cursor *cursors[FILES];
static uint32_t state = 29;

static uint32_t chance(uint32_t below)
{
    state = state * 1664525u + 1013904223u;
    return (uint32_t)(((uint64_t)state * below) >> 32);
}

static bool open_all(void)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/tests/golden/paged_float32.tetlod", getenv("ROOT") ? getenv("ROOT") : ".");
    FILE *in = fopen(getenv("STREAM") ? getenv("STREAM") : path, "rb");
    bytes = malloc(1 << 20);
    if (!in || !bytes)
        return false;
    size = fread(bytes, 1, 1 << 20, in);
    fclose(in);
    for (int i = 0; i < FILES; i++) {
        struct tetlod_options options = {.struct_size = sizeof options, .threads = 1u << i};
        if (tetlod_open_memory(&files[i], bytes, size, &options, NULL) != TETLOD_OK)
            return false;
    }
    return true;
}

/* The row of a page's frame that has bytes, at random. */
static size_t choose_frame(uint32_t *out_page)
{
    const struct tetlodi_index *index = &files[0]->index;
    uint32_t parts = 1 + index->info.field_count, part;
    do {
        *out_page = chance(index->pages.page_count);
        part = chance(parts);
    } while (!index->pages.frames[(size_t)*out_page * parts + part].size);
    return (size_t)*out_page * parts + part;
}

/* Its digest in all files becomes that of the bytes. */
static void seal(size_t row)
{
    const struct tetlodi_page_frame *frame = &files[0]->index.pages.frames[row];
    uint8_t digest[DIGEST_SIZE];
    tetlodi_digest(bytes + frame->offset, frame->size, digest);
    for (int i = 0; i < FILES; i++)
        memcpy(files[i]->index.pages.frames[row].digest, digest, DIGEST_SIZE);
}

/* A closed set with the page and some others, the same for every file. */
static struct tetlod_page_set *set_of(int i, const uint32_t *pages)
{
    const struct tetlodi_page_table *table = &files[i]->index.pages;
    struct tetlod_page_set *set = NULL;
    if (tetlod_page_set_new(&set, files[i], 0, NULL, 0, NULL) != TETLOD_OK)
        return NULL;
    for (int p = 0; p < PAGES; p++) {
        uint32_t group = 0;
        while (pages[p] >= table->groups[group].first_page + table->groups[group].page_count)
            group++;
        uint32_t number = pages[p] - table->groups[group].first_page;
        CHECK_INT(tetlod_page_set_add(set, table->first_level + group, number, NULL), TETLOD_OK);
    }
    return set;
}

/* The cursor goes to other pages. */
static enum tetlod_status decode(int i, const uint32_t *pages, struct tetlod_error *error)
{
    struct tetlod_page_set *set = set_of(i, pages);
    struct tetlod_page_set_info about;
    enum tetlod_status status = set ? tetlod_cursor_select(cursors[i], set, error) : TETLOD_ERR_NOMEM;
    if (status == TETLOD_OK) {
        tetlod_page_set_info(set, &about);
        status = tetlod_cursor_seek(cursors[i], about.level, error);
    }
    tetlod_page_set_free(set);
    return status;
}

static bool same(const struct tetlod_cursor *a, const struct tetlod_cursor *b)
{
    const struct tetlod_info *info = &files[0]->index.info;
    struct tetlod_mesh one, other;
    tetlod_cursor_mesh(a, &one);
    tetlod_cursor_mesh(b, &other);
    bool good = one.vertices == other.vertices && one.tets == other.tets && one.level == other.level &&
                memcmp(one.positions, other.positions, one.vertices * 3 * sizeof *one.positions) == 0 &&
                memcmp(one.corners, other.corners, (size_t)one.tets * 4 * sizeof *one.corners) == 0;
    for (uint32_t f = 0; good && f < info->field_count; f++)
        good = memcmp(one.fields[f], other.fields[f],
                      (size_t)one.vertices * info->fields[f].components * sizeof *one.fields[f]) == 0;
    return good;
}

/* The cursor on one thread and another go to the same pages, from scratch where one that has seen damage would say it
 * again, and fail alike or have the same mesh. Returns what they say. */
static enum tetlod_status decode_both(int other, const uint32_t *pages, bool scratch)
{
    struct tetlod_error errors[FILES] = {{0}};
    enum tetlod_status status[FILES];
    for (int i = 0; i <= other; i += other) {
        if (scratch) {
            tetlod_cursor_free(cursors[i]);
            cursors[i] = NULL;
            CHECK_INT(tetlod_cursor_new(&cursors[i], files[i], NULL, 0, NULL), TETLOD_OK);
        }
        status[i] = decode(i, pages, &errors[i]);
    }
    CHECK_INT(status[other], status[0]);
    CHECK_TEXT(errors[other].message, errors[0].message);
    CHECK_INT(errors[other].offset, errors[0].offset);
    CHECK(same(cursors[0], cursors[other]));
    return status[0];
}

static void choose_pages(uint32_t *pages)
{
    uint32_t few = chance(PAGES);
    for (uint32_t p = 0; p < PAGES; p++)
        pages[p] = p > few ? pages[0] : chance(files[0]->index.pages.page_count);
}

/* One page is changed and changed back. True: the changed one was refused. */
static bool mutate_one(void)
{
    uint32_t pages[PAGES];
    uint8_t before[MAX_CHANGES];
    uint64_t places[MAX_CHANGES];
    choose_pages(pages);
    size_t row = choose_frame(&pages[0]);
    const struct tetlodi_page_frame *frame = &files[0]->index.pages.frames[row];
    uint32_t changes = 1 + chance(MAX_CHANGES);
    for (uint32_t c = 0; c < changes; c++) {
        places[c] = frame->offset + chance(frame->size);
        before[c] = bytes[places[c]];
        bytes[places[c]] = (uint8_t)chance(256);
    }
    seal(row);
    int other = 1 + (int)chance(FILES - 1);
    enum tetlod_status status = decode_both(other, pages, true);
    for (uint32_t c = changes; c-- > 0;)
        bytes[places[c]] = before[c];
    seal(row);
    choose_pages(pages); // of others, perhaps
    decode_both(other, pages, false);
    return status != TETLOD_OK;
}

static void test_mutations(void)
{
    unsigned long count = getenv("MUTATIONS") ? strtoul(getenv("MUTATIONS"), NULL, 10) : MUTATIONS, refused = 0;
    for (unsigned long n = 0; n < count; n++)
        refused += mutate_one();
    printf("# %lu of %lu changed pages were refused\n", refused, count);
    CHECK(refused > count / 4);
}

/* What they leave behind is as it was. */
static void test_afterwards(void)
{
    struct tetlod_cursor *fresh;
    uint32_t level = files[0]->index.info.level_count - 1;
    REQUIRE(tetlod_cursor_new(&fresh, files[0], NULL, 0, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_cursor_seek(fresh, level, NULL), TETLOD_OK);
    for (int i = 0; i < FILES; i++) {
        tetlod_cursor_free(cursors[i]);
        REQUIRE(tetlod_cursor_new(&cursors[i], files[i], NULL, 0, NULL) == TETLOD_OK);
        CHECK_INT(tetlod_cursor_seek(cursors[i], level, NULL), TETLOD_OK);
        CHECK(same(fresh, cursors[i]));
    }
    tetlod_cursor_free(fresh);
}

int main(void)
{
    if (getenv("SEED"))
        state = (uint32_t)strtoul(getenv("SEED"), NULL, 10);
    if (!open_all()) {
        printf("Bail out! a stream or a cursor could not be had\n");
        return 1;
    }
    RUN(test_mutations);
    RUN(test_afterwards);
    for (int i = 0; i < FILES; i++) {
        tetlod_cursor_free(cursors[i]);
        tetlod_close(files[i]);
    }
    free(bytes);
    return test_end();
}
