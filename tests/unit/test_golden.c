/* SPDX-License-Identifier: BSD-3-Clause */
/* Streams of every version stay readable: each level's arrays have the hashes in the file beside the stream, on the way up and
 * on the way down, and each field of cells that in the file NAME.cells. With UPDATE=1 the hashes are written. */
#include <glob.h>
#include <stdlib.h>
#include <string.h>

#include "format/checksum.h"
#include "tests/test.h"

#include "format/tetlod.h"

/* Adds numbers of `size` bytes to the hash as little-endian ones, whatever the machine's are. */
static void add_numbers(struct tetlodi_sha256 *sha, const void *numbers, size_t count, size_t size)
{
    const uint8_t *at = numbers;
    for (size_t i = 0; i < count; i++, at += size) {
        uint64_t bits;
        uint32_t narrow;
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

static void hash_step(const struct tetlod_series *series, const struct tetlod_info *info, uint32_t vertices, char hash[65])
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    struct tetlodi_sha256 sha;
    tetlodi_sha256_init(&sha);
    for (uint32_t f = 0; f < steps->field_count; f++)
        add_numbers(&sha, tetlod_step_values(series, f), (size_t)vertices * info->fields[steps->fields[f]].components, 8);
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
        hash_step(series, info, info->levels[steps->bands[i / steps->step_count].level].vertices, hashes[i]);
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
        hash_step(series, info, info->levels[steps->bands[i / steps->step_count].level].vertices, hash);
        CHECK_TEXT(hash, hashes[i]);
    }
    CHECK_INT(tetlod_seek_step(series, cursor, 0, steps->step_count, NULL), TETLOD_ERR_ARGUMENT);
    CHECK(tetlod_step_values(series, steps->field_count) == NULL);
    CHECK_INT(tetlod_band_for_error(steps, steps->bands[0].error), 0);
    CHECK_INT(tetlod_step_for_time(steps, steps->times[steps->step_count - 1] + 1), steps->step_count - 1);
    fclose(list);
    free(hashes);
    tetlod_series_free(series);
}

static void check_stream(const char *path)
{
    char line[128], (*hashes)[65];
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    struct tetlod_error error;
    FILE *in = fopen(path, "rb");
    FILE *list = open_list(path, "levels");
    REQUIRE(in && list);
    REQUIRE(tetlod_open_fd(&file, fileno(in), NULL, &error) == TETLOD_OK);
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
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    fclose(list);
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
