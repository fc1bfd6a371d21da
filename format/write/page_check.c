/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/write/page_check.h"

#include <stdlib.h>
#include <string.h>

#include "format/read/cursor.h"
#include "format/fail.h"
#include "format/write/page_write.h"

struct check {
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    struct tetlodi_write_group *groups; /* those of the stream, as an encoder has them */
    struct tetlodi_page_writer pages;
    struct tetlodi_buffer *frames; /* [1 + field_count] of a level; sizes up to the page */
    struct tetlod_error *error;
};

static enum tetlod_status out_of_memory(const struct check *check)
{
    return tetlodi_fail_nomem(check->error, "the table of pages", check->file->index_bytes);
}

static void list_groups(struct check *check)
{
    const struct tetlodi_page_table *table = &check->file->index.pages;
    for (uint32_t g = 0; g < table->group_count; g++) {
        const struct tetlodi_group *group = &table->groups[g];
        union {
            const struct tetlodi_cut *in;
            struct tetlodi_cut *out;
        } tree = {group->tree}; // an encoder's is its own; it is only read
        check->groups[g] = (struct tetlodi_write_group){
            .tree = tree.out, .nodes = 2 * group->page_count - 1, .pages = group->page_count};
    }
}

/* Makes the rows of a group. The cursor is at the level before it. */
static enum tetlod_status check_group(struct check *check, uint32_t g)
{
    const struct tetlodi_page_table *table = &check->file->index.pages;
    uint32_t level = table->first_level + g, parts = 1 + check->file->index.info.field_count;
    struct tetlodi_replay *replay = &check->cursor->replay;
    if (!tetlodi_page_writer_begin(&check->pages, check->cursor->helpers, replay, &check->groups[g], level))
        return out_of_memory(check);
    tetlodi_page_writer_extend(&check->pages, check->cursor->helpers);
    check->pages.table.groups[g].node_count = table->groups[g].node_count; // a tree may be stored again
    uint32_t vertices = replay->vertices, tets = replay->tets;
    for (uint32_t part = 0; part < parts; part++)
        tetlodi_buffer_fini(&check->frames[part]);
    TETLOD_TRY(tetlodi_read_level(check->file, level, check->frames, check->error));
    for (uint32_t part = 0; part < parts; part++)
        check->frames[part].size = 0;
    TETLOD_TRY(tetlod_cursor_seek(check->cursor, level, check->error));
    for (uint32_t p = 0; p < table->groups[g].page_count; p++) {
        const struct tetlodi_page *page = &table->pages[table->groups[g].first_page + p];
        vertices += page->vertices;
        tets += page->tets;
        for (uint32_t part = 0; part < parts; part++)
            check->frames[part].size +=
                tetlodi_page_frame(table, check->file->index.info.field_count, &table->groups[g], p, part)->size;
        if (!tetlodi_page_writer_page(&check->pages, vertices, tets, check->frames))
            return out_of_memory(check);
    }
    tetlodi_page_writer_end(&check->pages, check->frames);
    tetlodi_page_writer_extend(&check->pages, check->cursor->helpers);
    return TETLOD_OK;
}

/* Does the table that was made have the bytes of the stream's? */
static enum tetlod_status compare(struct check *check)
{
    uint32_t section = tetlod_section_index(&check->file->index.info, TAG_PAGES);
    size_t size = (size_t)check->file->index.sections[section].plain;
    const double(*bounds)[3] = (const double(*)[3])check->file->index.info.bounds;
    const struct tetlodi_buffer *made = tetlodi_page_writer_section(&check->pages, bounds);
    uint8_t *bytes = malloc(size + 1);
    if (!bytes || made->failed) {
        free(bytes);
        return out_of_memory(check);
    }
    enum tetlod_status status = tetlod_section_read(check->file, section, bytes, check->error);
    if (status == TETLOD_OK && (made->size != size || memcmp(made->bytes, bytes, size) != 0))
        status = tetlodi_fail(check->error, TETLOD_ERR_STREAM,
                              "the table of pages does not go with the pages: digests, boxes or needs are others");
    free(bytes);
    return status;
}

enum tetlod_status tetlodi_check_pages(struct tetlod_file *file, struct tetlod_error *error)
{
    const struct tetlodi_page_table *table = &file->index.pages;
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    struct check check = {.file = file, .error = error};
    size_t parts = 1 + (size_t)file->index.info.field_count;
    struct tetlod_page_set *all = NULL;
    enum tetlod_status status;
    if (!table->group_count)
        return TETLOD_OK;
    check.groups = calloc(table->group_count, sizeof *check.groups);
    check.frames = calloc(parts, sizeof *check.frames);
    if (!check.groups || !check.frames)
        TETLOD_TRY_DONE(out_of_memory(&check));
    list_groups(&check);
    tetlodi_page_writer_init(&check.pages, &memory, check.groups, table->group_count, (uint32_t)parts - 1);
    TETLOD_TRY_DONE(tetlod_cursor_new(&check.cursor, file, (uint32_t[]){0}, 0, error));
    // as one who takes pages in and out: pages that do not keep to their part of space are refused then
    TETLOD_TRY_DONE(tetlod_page_set_new(&all, file, table->first_level + table->group_count - 1, NULL, 0, error));
    TETLOD_TRY_DONE(tetlod_cursor_select(check.cursor, all, error));
    TETLOD_TRY_DONE(tetlod_cursor_seek(check.cursor, table->first_level - 1, error));
    for (uint32_t g = 0; g < table->group_count; g++)
        TETLOD_TRY_DONE(check_group(&check, g));
    status = compare(&check);
done:
    for (size_t part = 0; part < parts && check.frames; part++)
        free(check.frames[part].bytes);
    free(check.frames);
    free(check.groups);
    tetlodi_page_writer_fini(&check.pages);
    tetlod_cursor_free(check.cursor);
    tetlod_page_set_free(all);
    return status;
}
