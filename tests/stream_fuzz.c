/* SPDX-License-Identifier: BSD-3-Clause */
#include "tests/stream_fuzz.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/coding/index.h"
#include "format/coding/page_decode.h"
#include "format/coding/time_table.h"
#include "tests/level_fuzz.h"

static void demand(int condition)
{
    if (!condition)
        abort();
}

/* Corners in range and different, numbers finite; the hash of all. */
static uint64_t check_mesh(const struct tetlod_cursor *cursor, const struct tetlod_info *info)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(cursor, &mesh);
    uint64_t hash = mesh.vertices;
    for (size_t t = 0; t < mesh.tets; t++)
        for (int c = 0; c < 4; c++) {
            uint32_t corner = mesh.corners[4 * t + (size_t)c];
            demand(corner < mesh.vertices);
            for (int d = 0; d < c; d++)
                demand(mesh.corners[4 * t + (size_t)d] != corner);
            hash = (hash ^ corner) * UINT64_C(1099511628211);
        }
    for (size_t i = 0; i < 3 * (size_t)mesh.vertices; i++)
        demand(isfinite(mesh.positions[i]));
    for (uint32_t f = 0; f < info->field_count; f++)
        for (size_t i = 0; i < (size_t)mesh.vertices * info->fields[f].components; i++)
            demand(isfinite(mesh.fields[f][i]));
    return hash;
}

/* Whatever the order part holds, it is numbers in range or an error. */
static void check_order(const struct tetlod_file *file, const struct tetlod_info *info)
{
    if (!info->keeps_order || info->tets > 1 << 20 || info->vertices > 1 << 20)
        return;
    uint32_t *vertices = malloc(info->vertices * sizeof *vertices), *tets = malloc(info->tets * sizeof *tets);
    uint8_t *corners = malloc(4 * (size_t)info->tets);
    demand(vertices && tets && corners);
    if (tetlod_order(file, vertices, tets, corners, NULL) == TETLOD_OK)
        for (size_t t = 0; t < info->tets; t++)
            demand(tets[t] < info->tets && corners[4 * t] < 4 && corners[4 * t] != corners[4 * t + 3]);
    free(vertices);
    free(tets);
    free(corners);
}

/* Whatever the cell data hold, reading them ends well. */
static void check_cells(const struct tetlod_file *file, const struct tetlod_info *info)
{
    for (uint32_t f = 0; f < info->cell_field_count && info->tets <= 1 << 20; f++) {
        const struct tetlod_cell_field *field = &info->cell_fields[f];
        demand(*field->name && field->range[0] <= field->range[1] && tetlod_cell_field_index(info, field->name) == f);
        double *values = malloc((size_t)info->tets * field->components * sizeof *values);
        demand(values && tetlod_cells(file, f, values, NULL) != TETLOD_ERR_ARGUMENT);
        free(values);
    }
}

/* Values of cells forwards and back. */
static void check_cell_steps(struct tetlod_series *series, const struct tetlod_info *info)
{
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    for (uint32_t f = 0; f < info->cell_field_count && f < 4; f++) {
        double *values = malloc((size_t)info->tets * info->cell_fields[f].components * sizeof *values + 1);
        demand(values != NULL);
        for (uint32_t s = 0; s < steps->step_count && s < 20; s++)
            demand((tetlod_step_cells(series, f, s ^ 1, values, NULL) != TETLOD_ERR_ARGUMENT) ==
                   tetlod_has_step_cells(series, f, s ^ 1));
        free(values);
    }
}

/* Steps forwards and back are the same, and finite. */
static void check_steps(struct tetlod_file *file, const struct tetlod_info *info)
{
    struct tetlod_series *series;
    struct tetlod_cursor *cursor;
    if (tetlod_series_new(&series, file, NULL) != TETLOD_OK)
        return;
    const struct tetlod_series_info *steps = tetlod_series_info(series);
    demand(tetlod_cursor_new(&cursor, file, steps->fields, 0, NULL) != TETLOD_ERR_ARGUMENT);
    for (uint32_t b = 0; b < steps->band_count && b < 4 && cursor; b++)
        for (uint32_t s = 0; s < steps->step_count && s < 20; s++) {
            if (tetlod_seek_step(series, cursor, b, s ^ 1, NULL) != TETLOD_OK)
                continue;
            struct tetlod_mesh mesh;
            tetlod_cursor_mesh(cursor, &mesh);
            for (uint32_t f = 0; f < steps->field_count; f++)
                for (size_t i = 0; i < (size_t)mesh.vertices * info->fields[steps->fields[f]].components; i++)
                    demand(isfinite(tetlod_step_values(series, f)[i]));
            double *points = malloc(24 * (size_t)mesh.vertices);
            demand(points != NULL);
            memcpy(points, mesh.positions, 24 * (size_t)mesh.vertices);
            if (tetlod_step_move(series, points, NULL) == TETLOD_OK)
                for (size_t i = 0; i < 3 * (size_t)mesh.vertices; i++)
                    demand(isfinite(points[i]));
            free(points);
        }
    check_cell_steps(series, info);
    tetlod_cursor_free(cursor);
    tetlod_series_free(series);
}

/* Some pages, and others, chosen by the bytes' number. */
static void check_pages(struct tetlod_file *file, const struct tetlod_info *info, size_t seed)
{
    struct tetlod_page_set *set;
    struct tetlod_page_set_info what;
    struct tetlod_cursor *cursor;
    if (!info->page_count || tetlod_page_set_new(&set, file, 0, NULL, 0, NULL) != TETLOD_OK)
        return;
    demand(tetlod_cursor_new(&cursor, file, NULL, 0, NULL) != TETLOD_ERR_ARGUMENT);
    for (uint32_t level = info->first_paged_level; level < info->level_count && cursor; level++) {
        uint32_t pages = tetlod_page_count(file, level);
        if (!pages)
            continue;
        demand(tetlod_page_set_add(set, level, (uint32_t)(seed % pages), NULL) == TETLOD_OK);
        demand(tetlod_page_set_spans(set, NULL, 0, 100, NULL, 0) <= info->page_count * (1 + (size_t)info->field_count));
        demand(tetlod_page_spans(file, level, (uint32_t)(seed % pages), NULL, 0, NULL, 0) <= 1 + info->field_count);
        tetlod_page_set_info(set, &what);
        demand(tetlod_cursor_select(cursor, set, NULL) == TETLOD_OK);
        if (tetlod_cursor_seek(cursor, level, NULL) == TETLOD_OK)
            check_mesh(cursor, info);
        seed = seed * 31 + 7;
    }
    if (cursor)
        demand(tetlod_cursor_seek(cursor, 0, NULL) == TETLOD_OK);
    tetlod_cursor_free(cursor);
    tetlod_page_set_free(set);
}

/* In pieces, as from the network: all of them, or as if they were what belongs to one field. */
static void feed_fuzz(const uint8_t *bytes, size_t size, const struct tetlod_options *options, const char *field)
{
    struct tetlod_feed *feed;
    struct tetlod_cursor *cursor = NULL;
    uint32_t none = 0, count = 0;
    demand(tetlod_feed_new(&feed, options, NULL) == TETLOD_OK);
    demand(!field || tetlod_feed_select(feed, &field, 1, NULL) == TETLOD_OK);
    for (size_t at = 0, piece = size / 3 + 1; at < size; at += piece) {
        enum tetlod_status status = tetlod_feed_add(feed, bytes + at, size - at < piece ? size - at : piece, NULL);
        uint32_t level = tetlod_feed_level(feed);
        if ((status != TETLOD_OK && status != TETLOD_MORE) || level == TETLOD_NONE)
            continue;
        demand(tetlod_feed_bytes(feed, level) <= at + piece);
        count = field ? 1 : tetlod_info(tetlod_feed_file(feed))->field_count;
        if (!cursor && tetlod_cursor_new(&cursor, tetlod_feed_file(feed), field ? &none : NULL, count,
                                         NULL) != TETLOD_OK)
            break;
        if (tetlod_cursor_seek(cursor, level < 16 ? level : 16, NULL) != TETLOD_OK)
            break;
    }
    tetlod_cursor_free(cursor);
    tetlod_feed_free(feed);
}

void stream_fuzz(const uint8_t *bytes, size_t size)
{
    struct tetlod_options options = {.struct_size = sizeof options, .max_bytes = 64 << 20, .threads = 1 + size % 2};
    struct tetlod_error error;
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    if (tetlod_open_memory(&file, bytes, size, &options, &error) != TETLOD_OK)
        return;
    const struct tetlod_info *info = tetlod_info(file);
    check_order(file, info);
    check_cells(file, info);
    check_steps(file, info);
    feed_fuzz(bytes, size, &options, NULL);
    if (info->field_count)
        feed_fuzz(bytes, size, &options, info->fields[0].name);
    if (tetlod_cursor_new(&cursor, file, NULL, 0, &error) == TETLOD_OK) {
        uint64_t base = check_mesh(cursor, info);
        uint32_t reached = 0;
        while (reached + 1 < info->level_count && reached < 64 &&
               tetlod_cursor_seek(cursor, reached + 1, &error) == TETLOD_OK)
            reached++;
        uint64_t top = check_mesh(cursor, info);
        demand(tetlod_cursor_seek(cursor, 0, &error) == TETLOD_OK && check_mesh(cursor, info) == base);
        while (tetlod_cursor_coarsen(cursor, &error) == TETLOD_OK)
            abort();
        demand(tetlod_cursor_seek(cursor, reached, &error) == TETLOD_OK && check_mesh(cursor, info) == top);
        tetlod_cursor_free(cursor);
        check_pages(file, info, size);
        level_fuzz(file);
    }
    tetlod_close(file);
}

static const struct tetlodi_section *section_of(const struct tetlodi_index *index, const char *tag, uint32_t number)
{
    for (uint32_t i = 0; i < index->info.section_count; i++)
        if (strcmp(index->sections[i].tag, tag) == 0 && number-- == 0)
            return &index->sections[i];
    return NULL;
}

/* The digests of groups of steps, in a table that is not packed. */
static void seal_steps(const struct tetlodi_index *index, uint8_t *bytes, size_t size)
{
    const struct tetlodi_section *table = section_of(index, TAG_TIME, 0), *values;
    struct tetlodi_time time = {0};
    if (!table || table->flags & SECTION_PACKED || table->frame.offset > size ||
        table->frame.size > size - table->frame.offset)
        return;
    uint8_t *end = bytes + table->frame.offset + table->frame.size;
    if (tetlodi_time_decode(&time, bytes + table->frame.offset, (size_t)table->frame.size, NULL) == TETLOD_OK)
        for (uint32_t row = 0; row < time.field_count * time.band_count; row++)
            for (uint32_t g = 0; g < time.group_count && (values = section_of(index, TAG_STEP_VALUES, row)); g++) {
                uint64_t at, length, groups = (uint64_t)time.field_count * time.band_count * time.group_count;
                tetlodi_time_place(&time, row / time.band_count, row % time.band_count, g, &at, &length);
                if (values->frame.offset <= size && at + length <= size - values->frame.offset)
                    tetlodi_digest(bytes + values->frame.offset + at, (size_t)length,
                                   end - DIGEST_SIZE * (groups - (uint64_t)row * time.group_count - g));
            }
    tetlodi_time_fini(&time);
}

/* The digests of pages, in a table that is not packed. */
static void seal_pages(const struct tetlodi_index *index, uint8_t *bytes, size_t size)
{
    const struct tetlodi_section *section = section_of(index, TAG_PAGES, 0);
    uint32_t levels = index->info.level_count - (index->tail ? 1 : 0), fields = index->info.field_count;
    struct tetlodi_page_table table = {0};
    struct tetlodi_buffer out = {0};
    if (!section || section->flags & SECTION_PACKED || section->frame.offset > size ||
        section->frame.size > size - section->frame.offset)
        return;
    uint8_t *at = bytes + section->frame.offset;
    if (tetlodi_page_table_decode(&table, levels, fields, at, (size_t)section->frame.size, NULL) == TETLOD_OK) {
        uint64_t offset = index->info.levels[table.first_level].offset;
        for (const struct tetlodi_group *group = table.groups; group < table.groups + table.group_count; group++)
            for (size_t i = 0; i < (fields + (size_t)1) * group->page_count; i++) {
                struct tetlodi_page_place place = tetlodi_page_place(i, group->page_count, 1 + fields);
                struct tetlodi_page_frame *frame = tetlodi_page_frame(&table, fields, group, place.page, place.part);
                if (offset <= size && frame->size <= size - offset)
                    tetlodi_digest(bytes + offset, frame->size, frame->digest);
                offset += frame->size;
            }
        tetlodi_page_table_encode(&table, table.group_count, fields, &out);
        if (!out.failed && out.size == section->frame.size)
            memcpy(at, out.bytes, out.size);
    }
    tetlodi_buffer_fini(&out);
    tetlodi_page_table_fini(&table);
}

/* Where the index's digests are: behind the levels' sizes, and at the end of every section's entry. */
static void seal_parts(uint8_t *bytes, size_t size, size_t index_size)
{
    struct tetlodi_index index;
    if (tetlodi_index_decode(&index, bytes + HEADER_SIZE, index_size, HEADER_SIZE + index_size, NULL) != TETLOD_OK)
        return;
    size_t fields = index.info.field_count, sections = index.info.section_count,
           row = tetlodi_index_row((uint32_t)fields);
    uint8_t *directory = bytes + HEADER_SIZE + index_size - sections * SECTION_ENTRY;
    uint8_t *levels = directory - 4 - index.info.level_count * row;
    for (uint32_t k = 0; k < index.info.level_count; k++)
        for (size_t part = 0; part <= fields; part++) {
            const struct tetlodi_frame *frame = &index.frames[k * (fields + 1) + part];
            const bool in_pages = memcmp(frame->digest, (const uint8_t[DIGEST_SIZE]){0}, DIGEST_SIZE) == 0;
            if (!in_pages && frame->offset <= size && frame->size <= size - frame->offset)
                tetlodi_digest(bytes + frame->offset, (size_t)frame->size,
                               levels + (k + 1) * row - 24 * (fields + 1 - part) + 8);
        }
    seal_steps(&index, bytes, size);
    seal_pages(&index, bytes, size);
    for (size_t i = 0; i < sections; i++) {
        const struct tetlodi_frame *frame = &index.sections[i].frame;
        if (frame->offset <= size && frame->size <= size - frame->offset)
            tetlodi_digest(bytes + frame->offset, (size_t)frame->size,
                           directory + (i + 1) * SECTION_ENTRY - DIGEST_SIZE);
    }
    tetlodi_index_fini(&index);
}

void stream_fuzz_seal(uint8_t *bytes, size_t size)
{
    uint8_t digest[DIGEST_SIZE];
    if (size < HEADER_SIZE)
        return;
    memcpy(bytes, TETLODI_MAGIC "\x02\0\0", 11);
    size_t index_size = bytes[20] | (size_t)bytes[21] << 8 | (size_t)bytes[22] << 16 | (size_t)bytes[23] << 24;
    if (index_size > size - HEADER_SIZE)
        return;
    if (memcmp(bytes + 20, bytes + 24, 4) == 0)
        seal_parts(bytes, size, index_size);
    tetlodi_content_id(bytes, bytes + HEADER_SIZE, index_size, digest);
    memcpy(bytes + 40, digest, sizeof digest);
    tetlodi_digest(bytes, 60, digest);
    memcpy(bytes + 60, digest, 4);
}

uint8_t *stream_fuzz_plain(const uint8_t *bytes, size_t size, size_t *out_size)
{
    struct tetlodi_header header;
    uint8_t *index;
    if (size < HEADER_SIZE || tetlodi_header_decode(&header, bytes, NULL) != TETLOD_OK ||
        header.index_size > size - HEADER_SIZE ||
        tetlodi_index_unpack(&header, bytes + HEADER_SIZE, &index, NULL) != TETLOD_OK)
        return NULL;
    size_t rest = size - HEADER_SIZE - header.index_size;
    uint8_t *out = malloc(HEADER_SIZE + header.index_plain + rest);
    demand(out != NULL);
    *out_size = HEADER_SIZE + header.index_plain + rest;
    header.file_size += header.index_plain - header.index_size;
    memcpy(out + HEADER_SIZE, index, header.index_plain);
    memcpy(out + HEADER_SIZE + header.index_plain, bytes + HEADER_SIZE + header.index_size, rest);
    header.index_size = header.index_plain;
    tetlodi_header_encode(&header, out);
    free(index);
    stream_fuzz_seal(out, *out_size);
    return out;
}
