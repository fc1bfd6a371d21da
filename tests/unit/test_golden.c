/* SPDX-License-Identifier: BSD-3-Clause */
/* Streams of every version stay readable: each level's arrays have the hashes in the file beside the stream, on the way
 * up and on the way down, and each field of cells that in the file NAME.cells. With UPDATE=1 the hashes are written. */
#include <glob.h>
#include <stdlib.h>
#include <string.h>

#include "format/common/checksum.h"
#include "tests/test.h"

#include "format/tetlod.h"

/* Adds numbers of `size` bytes to the hash as little-endian ones, whatever the machine's are. */
static void add_numbers(struct tetlodi_sha256 *sha, const void *numbers, size_t count, size_t size)
{
    const uint8_t *at = numbers;
    for (size_t i = 0; i < count; i++, at += size) {
        uint64_t bits = 0;
        uint32_t narrow = 0;
        uint8_t bytes[8];
        if (size == 8)
            memcpy(&bits, at, 8);
        else
            memcpy(&narrow, at, 4);
        for (size_t k = 0; k < size; k++)
            bytes[k] = (uint8_t)((size == 8 ? bits : narrow) >> (8 * k));
        tetlodi_sha256_add(sha, bytes, size);
    }
}

static void hash_text(struct tetlodi_sha256 *sha, char out[65])
{
    uint8_t digest[32];
    tetlodi_sha256_finish(sha, digest);
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", digest[i]);
}

/* SHA-256 over positions, tetrahedra and fields, little-endian, as text. */
static void hash_mesh(const struct tetlod_cursor *cursor, const struct tetlod_info *info, char out[65])
{
    struct tetlodi_sha256 sha;
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(cursor, &mesh);
    tetlodi_sha256_init(&sha);
    add_numbers(&sha, mesh.positions, 3 * (size_t)mesh.vertices, 8);
    add_numbers(&sha, mesh.corners, 4 * (size_t)mesh.tets, 4);
    for (uint32_t f = 0; f < info->field_count; f++)
        add_numbers(&sha, mesh.fields[f], (size_t)mesh.vertices * info->fields[f].components, 8);
    hash_text(&sha, out);
}

/* The list of hashes beside a stream. */
static FILE *open_list(const char *path, const char *kind)
{
    char name[4096];
    snprintf(name, sizeof name, "%s.%s", path, kind);
    return fopen(name, getenv("UPDATE") ? "w+" : "r");
}

static void check_cells(const struct tetlod_file *file, const char *path)
{
    const struct tetlod_info *info = tetlod_info(file);
    char hash[65], line[128];
    FILE *list = info->cell_field_count ? open_list(path, "cells") : NULL;
    CHECK(!info->cell_field_count || list);
    for (uint32_t f = 0; f < info->cell_field_count && list; f++) {
        struct tetlodi_sha256 sha;
        size_t count = (size_t)info->tets * info->cell_fields[f].components;
        double *values = malloc(count * sizeof *values);
        CHECK_INT(tetlod_cells(file, f, values, NULL), TETLOD_OK);
        tetlodi_sha256_init(&sha);
        add_numbers(&sha, values, count, 8);
        hash_text(&sha, hash);
        free(values);
        if (getenv("UPDATE"))
            fprintf(list, "%s\n", hash);
        else if (fgets(line, sizeof line, list))
            CHECK(strncmp(line, hash, 64) == 0);
        else
            CHECK(!"a hash for each field");
    }
    if (list)
        fclose(list);
}

/* The values of each field of cells with steps at every step, forwards; then backwards, which must not matter. */
static void check_cell_steps(const struct tetlod_file *file, struct tetlod_series *series, const char *path)
{
    const struct tetlod_info *info = tetlod_info(file);
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    uint32_t count = steps->cell_field_count * steps->step_count;
    FILE *list = count ? open_list(path, "cell_steps") : NULL;
    char (*hashes)[65] = malloc((count + 1) * sizeof *hashes), line[128];
    CHECK(!count || list);
    for (uint32_t i = 0; i < 2 * count && list; i++) {
        uint32_t at = i < count ? i : 2 * count - 1 - i, field = steps->cell_fields[at / steps->step_count];
        size_t numbers = (size_t)info->tets * info->cell_fields[field].components;
        double *values = malloc(numbers * sizeof *values);
        struct tetlodi_sha256 sha;
        CHECK(tetlod_has_step_cells(series, field, at % steps->step_count));
        CHECK_INT(tetlod_step_cells(series, field, at % steps->step_count, values, NULL), TETLOD_OK);
        tetlodi_sha256_init(&sha);
        add_numbers(&sha, values, numbers, 8);
        hash_text(&sha, i < count ? hashes[at] : line);
        CHECK_TEXT(i < count ? hashes[at] : line, hashes[at]);
        if (i < count && getenv("UPDATE"))
            fprintf(list, "%s\n", hashes[at]);
        free(values);
    }
    for (uint32_t i = 0; i < count && list; i++) {
        if (i == 0)
            rewind(list);
        REQUIRE(fgets(line, sizeof line, list) != NULL);
        line[strcspn(line, "\n")] = 0;
        CHECK_TEXT(hashes[i], line);
    }
    for (uint32_t f = 0; f < info->cell_field_count; f++)
        CHECK_INT(tetlod_step_cells(series, f, steps->step_count, NULL, NULL), TETLOD_ERR_ARGUMENT);
    if (list)
        fclose(list);
    free(hashes);
}

static void add_points(struct tetlodi_sha256 *sha, const struct tetlod_series *series, const struct tetlod_mesh *mesh)
{
    double *points = malloc(24 * (size_t)mesh->vertices);
    REQUIRE(points);
    memcpy(points, mesh->positions, 24 * (size_t)mesh->vertices);
    CHECK_INT(tetlod_step_move(series, points, NULL), TETLOD_OK);
    add_numbers(sha, points, 3 * (size_t)mesh->vertices, 8);
    free(points);
}

/* The values of its fields; of points that move their places, too. */
static void hash_step(const struct tetlod_series *series, const struct tetlod_info *info,
                      const struct tetlod_cursor *cursor, char hash[65])
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    struct tetlodi_sha256 sha;
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(cursor, &mesh);
    tetlodi_sha256_init(&sha);
    for (uint32_t f = 0; f < steps->field_count; f++)
        add_numbers(&sha, tetlod_step_values(series, f),
                    (size_t)mesh.vertices * info->fields[steps->fields[f]].components, 8);
    if (steps->displacement != TETLOD_NONE)
        add_points(&sha, series, &mesh);
    hash_text(&sha, hash);
}

/* Every step in every band, forwards; then backwards, which must not matter. */
static void check_steps(const struct tetlod_file *file, struct tetlod_cursor *cursor, const char *path)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlod_series *series;
    char hash[65], line[128];
    if (tetlod_series_new(&series, file, NULL) != TETLOD_OK) {
        CHECK_INT(tetlod_section_index(info, "TIME"), TETLOD_NONE);
        return;
    }
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    FILE *list = open_list(path, "steps");
    REQUIRE(list);
    uint32_t count = steps->band_count * steps->step_count;
    char (*hashes)[65] = malloc(count * sizeof *hashes);
    for (uint32_t i = 0; i < count; i++) {
        CHECK_INT(tetlod_seek_step(series, cursor, i / steps->step_count, i % steps->step_count, NULL), TETLOD_OK);
        hash_step(series, info, cursor, hashes[i]);
        if (getenv("UPDATE"))
            fprintf(list, "%s\n", hashes[i]);
    }
    rewind(list);
    for (uint32_t i = 0; i < count; i++) {
        REQUIRE(fgets(line, sizeof line, list) != NULL);
        line[strcspn(line, "\n")] = 0;
        CHECK_TEXT(hashes[i], line);
    }
    for (uint32_t i = count; i-- > 0;) {
        CHECK_INT(tetlod_seek_step(series, cursor, i / steps->step_count, i % steps->step_count, NULL), TETLOD_OK);
        hash_step(series, info, cursor, hash);
        CHECK_TEXT(hash, hashes[i]);
    }
    check_cell_steps(file, series, path);
    CHECK_INT(tetlod_seek_step(series, cursor, 0, steps->step_count, NULL), TETLOD_ERR_ARGUMENT);
    CHECK(tetlod_step_values(series, steps->field_count) == NULL);
    CHECK_INT(tetlod_band_for_error(steps, steps->bands[0].error), 0);
    for (uint32_t s = 0; s < steps->step_count; s++) {
        double error = 0, units = 0;
        for (uint32_t f = 0; f < steps->field_count; f++) {
            error = fmax(error, tetlod_step_error(series, f, 0, s));
            units = fmax(units, tetlod_step_error(series, f, 0, s) * (steps->ranges[f][1] - steps->ranges[f][0]));
        }
        CHECK_INT(tetlod_band_for_step(series, s, error), 0);
        CHECK_INT(tetlod_band_for_step_abs(series, s, units), 0);
        CHECK(error == 0 || tetlod_band_for_step(series, s, nextafter(error, 0)) != 0);
        CHECK(units == 0 || tetlod_band_for_step_abs(series, s, nextafter(units, 0)) != 0);
    }
    CHECK_INT(tetlod_band_for_step(series, steps->step_count, 1), TETLOD_NONE);
    CHECK_INT(tetlod_step_for_time(steps, steps->times[steps->step_count - 1] + 1), steps->step_count - 1);
    fclose(list);
    free(hashes);
    tetlod_series_free(series);
}

static uint8_t *read_span(FILE *in, struct tetlod_span span)
{
    uint8_t *bytes = malloc((size_t)span.size + 1);
    fseek(in, (long)span.offset, SEEK_SET);
    return bytes && fread(bytes, 1, (size_t)span.size, in) == span.size ? bytes : NULL;
}

static void put_span(struct tetlod_feed *feed, FILE *in, struct tetlod_span span)
{
    uint8_t *bytes = read_span(in, span);
    REQUIRE(bytes);
    CHECK_INT(tetlod_feed_put(feed, span.offset, bytes, (size_t)span.size, NULL), TETLOD_OK);
    free(bytes);
}

/* The geometry of a band's level, and of one field the group of its last step. */
static void feed_band(struct tetlod_feed *feed, FILE *in, const struct tetlod_file *whole, uint32_t level)
{
    static const uint32_t none[1] = {0};
    struct tetlod_span spans[256];
    size_t count = tetlod_spans(whole, TETLOD_NONE, level, none, 0, spans, 256);
    REQUIRE(count <= 256);
    for (size_t i = 0; i < count; i++) {
        uint8_t *bytes = read_span(in, spans[i]);
        REQUIRE(bytes);
        CHECK_INT(tetlod_feed_add(feed, bytes, (size_t)spans[i].size, NULL), TETLOD_OK);
        free(bytes);
    }
}

/* What a browser does: the prefix in order and without fields, the table and a group out of turn. */
static void check_fed_steps(const struct tetlod_file *whole, struct tetlod_cursor *reference, FILE *in)
{
    static const uint32_t none[1] = {0}, first[1] = {0};
    const struct tetlod_info *info = tetlod_info(whole);
    uint32_t section = tetlod_section_index(info, "TIME");
    struct tetlod_series *series, *fed;
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor;
    struct tetlod_mesh mesh;
    if (section == TETLOD_NONE)
        return;
    REQUIRE(tetlod_series_new(&series, whole, NULL) == TETLOD_OK && tetlod_feed_new(&feed, NULL, NULL) == TETLOD_OK);
    CHECK_INT(tetlod_feed_select(feed, NULL, 0, NULL), TETLOD_OK);
    CHECK_INT(tetlod_feed_put(feed, 0, "x", 1, NULL), TETLOD_ERR_ARGUMENT); // no index yet
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    uint32_t band = steps->band_count / 2, step = steps->step_count - 1, level = steps->bands[band].level;
    feed_band(feed, in, whole, level);
    CHECK_INT(tetlod_series_new(&fed, tetlod_feed_file(feed), NULL), TETLOD_ERR_TRUNCATED);
    put_span(feed, in, (struct tetlod_span){info->sections[section].offset, info->sections[section].stored});
    if (strcmp(info->sections[section + 1].tag, "CTIM") == 0 || strcmp(info->sections[section + 1].tag, "PTIM") == 0)
        put_span(feed, in,
                 (struct tetlod_span){info->sections[section + 1].offset, info->sections[section + 1].stored});
    REQUIRE(tetlod_series_new(&fed, tetlod_feed_file(feed), NULL) == TETLOD_OK);
    tetlod_feed_forget(feed);
    REQUIRE(tetlod_cursor_new(&cursor, tetlod_feed_file(feed), none, 0, NULL) == TETLOD_OK);
    tetlod_series_select(fed, first, 1);
    CHECK_INT(tetlod_seek_step(fed, cursor, band, step, NULL), TETLOD_ERR_TRUNCATED);
    put_span(feed, in, tetlod_step_span(fed, 0, band, step));
    if (steps->displacement != TETLOD_NONE) // comes with any
        put_span(feed, in, tetlod_step_span(fed, steps->displacement, band, step));
    CHECK_INT(tetlod_seek_step(fed, cursor, band, step, NULL), TETLOD_OK);
    tetlod_feed_forget(feed);
    CHECK_INT(tetlod_seek_step(series, reference, band, step, NULL), TETLOD_OK);
    size_t size = (size_t)info->levels[level].vertices * info->fields[steps->fields[0]].components * sizeof(double);
    CHECK(memcmp(tetlod_step_values(fed, 0), tetlod_step_values(series, 0), size) == 0);
    CHECK(steps->field_count == 1 || steps->displacement == 1 || !tetlod_step_values(fed, 1));
    tetlod_cursor_mesh(reference, &mesh);
    CHECK_INT(tetlod_series_decode(fed, mesh.corners, band, step, NULL), TETLOD_OK);
    CHECK(memcmp(tetlod_step_values(fed, 0), tetlod_step_values(series, 0), size) == 0);
    tetlod_series_free(fed);
    tetlod_series_free(series);
    tetlod_cursor_free(cursor);
    tetlod_feed_free(feed);
}

/* Whatever the lists of this path say: levels, cells, steps. */
static void check_file(struct tetlod_file *file, const char *path, FILE *in)
{
    char line[128], (*hashes)[65];
    struct tetlod_cursor *cursor;
    struct tetlod_error error;
    FILE *list = open_list(path, "levels");
    REQUIRE(list);
    REQUIRE(tetlod_cursor_new(&cursor, file, NULL, 0, &error) == TETLOD_OK);
    const struct tetlod_info *info = tetlod_info(file);
    hashes = malloc(info->level_count * sizeof *hashes);
    for (uint32_t k = 0; k < info->level_count; k++) {
        CHECK_INT(tetlod_cursor_seek(cursor, k, &error), TETLOD_OK);
        hash_mesh(cursor, info, hashes[k]);
        if (getenv("UPDATE"))
            fprintf(list, "%s\n", hashes[k]);
    }
    rewind(list);
    for (uint32_t k = 0; k < info->level_count; k++) {
        REQUIRE(fgets(line, sizeof line, list) != NULL);
        line[strcspn(line, "\n")] = 0;
        CHECK_TEXT(hashes[k], line);
    }
    for (uint32_t k = info->level_count; k-- > 0;) {
        CHECK_INT(tetlod_cursor_seek(cursor, k, &error), TETLOD_OK);
        hash_mesh(cursor, info, line);
        CHECK_TEXT(line, hashes[k]);
    }
    free(hashes);
    check_cells(file, path);
    check_steps(file, cursor, path);
    if (in)
        check_fed_steps(file, cursor, in);
    tetlod_cursor_free(cursor);
    fclose(list);
}

/* Each topology group as a stream of its own: those behind the first have lists of their own. */
static void check_topologies(const struct tetlod_file *file, const char *path)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlod_file *part;
    uint32_t steps = 0, own;
    for (uint32_t t = 0; t < info->topology_count; t++) {
        const struct tetlod_topology *topology = &info->topologies[t];
        char lists[4096];
        snprintf(lists, sizeof lists, "%s.%u", path, t);
        REQUIRE(tetlod_open_topology(&part, file, t, NULL) == TETLOD_OK);
        CHECK_TEXT(tetlod_info(part)->cid, topology->cid);
        CHECK(tetlod_info(part)->bytes == topology->size);
        if (t)
            check_file(part, lists, NULL);
        tetlod_close(part);
        CHECK_INT(tetlod_topology_of_step(info, steps, &own), t);
        CHECK_INT(own, 0);
        CHECK_INT(tetlod_topology_for_time(info, topology->times[topology->step_count - 1]), t);
        steps += topology->step_count;
        CHECK_INT(tetlod_topology_of_step(info, steps - 1, &own), t);
        CHECK_INT(own, topology->step_count - 1);
    }
    CHECK_INT(tetlod_topology_of_step(info, steps, NULL), TETLOD_NONE);
    CHECK_INT(tetlod_open_topology(&part, file, info->topology_count, NULL), TETLOD_ERR_ARGUMENT);
}

static void check_stream(const char *path)
{
    struct tetlod_file *file;
    FILE *in = fopen(path, "rb");
    REQUIRE(in);
    REQUIRE(tetlod_open_fd(&file, fileno(in), NULL, NULL) == TETLOD_OK);
    check_file(file, path, in);
    check_topologies(file, path);
    tetlod_close(file);
    fclose(in);
}

static void test_golden_streams(void)
{
    char pattern[4096];
    glob_t found;
    snprintf(pattern, sizeof pattern, "%s/tests/golden/*.tetlod", getenv("ROOT") ? getenv("ROOT") : ".");
    REQUIRE(glob(pattern, 0, NULL, &found) == 0);
    for (size_t i = 0; i < found.gl_pathc; i++)
        check_stream(found.gl_pathv[i]);
    CHECK(found.gl_pathc >= 7);
    globfree(&found);
}

int main(void)
{
    RUN(test_golden_streams);
    return test_end();
}
