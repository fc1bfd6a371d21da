/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh, and the pages of its next level. 1. The page of each tetrahedron, and who has each vertex: one page, or
 * several (a seam). 2. Each page, on any thread: a mesh of its tetrahedra in numbers of its own, its records, and the
 * result put back where it belongs; what it adds has places that the table of pages says before. 3. The logs of all
 * pages, one after the other, between those of pages that were there before. Numbers inside a page are in the order of
 * those outside, which is all that a record depends on.
 */
#include "format/read/page_parts.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/page_part.h"
#include "format/coding/record_fields.h"
#include "format/fail.h"
#include "format/read/page_runs.h"

enum { RECORDS = 96 }; /* whose fields are decoded in one go, as on one thread */

struct part {
    struct tetlodi_page_part mesh;
    uint64_t labels;
    int unread; /* its frames could not be read */
    int done;   /* it has been put back */
    struct tetlod_error error;
};

struct level {
    struct tetlod_cursor *cursor;
    uint32_t number;
    const struct tetlodi_coming *coming; /* some of the pages; NULL: all */
    struct tetlodi_page_shares shares;
    struct part *parts;
    uint32_t part_count;
    uint64_t share;                      /* of memory that a part may take */
};

/* ---- what pages have */

enum { TETS_A_TASK = 1 << 14 };

/* The page of a tetrahedron that is in one of this level: the level before has the last one that it was in. */
static uint32_t page_of_tet(const struct level *level, uint32_t t)
{
    const struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_group *group = cursor->group;
    const uint32_t *corners = cursor->replay.corners + 4 * (size_t)t;
    if (level->coming) {
        uint32_t last = cursor->choice->page_of[t], first_level = cursor->file->index.pages.first_level;
        if (last == NOT_THERE)
            return NOT_THERE;
        if (level->number == first_level ? last != TETLOD_NONE : last - group[-1].first_page >= group[-1].page_count)
            return TETLOD_NONE;
    }
    uint32_t page = tetlodi_page_at_corners(group->tree, cursor->columns[0].values, corners);
    return !level->coming || level->coming->pages[group->first_page + page] ? page : TETLOD_NONE;
}

static int find_some(void *opaque, uint32_t task)
{
    const struct level *level = opaque;
    uint32_t end = level->shares.tets - task * (uint32_t)TETS_A_TASK;
    end = task * (uint32_t)TETS_A_TASK + (end < TETS_A_TASK ? end : TETS_A_TASK);
    for (uint32_t t = task * (uint32_t)TETS_A_TASK; t < end; t++)
        level->shares.page_of[t] = page_of_tet(level, t);
    return 1;
}

/* ---- one page */

static enum tetlod_status decode_fields(struct tetlodi_recorder *recorder, struct tetlod_error *error)
{
    if (!recorder->log || !recorder->log->count)
        return TETLOD_OK;
    if (!tetlodi_fields_room(recorder))
        return tetlodi_no_room(recorder->replay->memory, error);
    for (uint32_t c = 1; c < recorder->replay->column_count; c++) {
        tetlodi_field_decode(recorder, recorder->log, c);
        if (recorder->coders[c].bad)
            return tetlodi_fail_field(recorder->coders[c].bad, error);
    }
    tetlodi_field_log_clear(recorder->log);
    return TETLOD_OK;
}

/* The records, of frames that the coders were started on. */
static enum tetlod_status decode_records(struct tetlodi_recorder *recorder, uint32_t page, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    while (replay->vertices < recorder->most_vertices) {
        if (recorder->log && recorder->log->count == RECORDS)
            TETLOD_TRY(decode_fields(recorder, error));
        struct tetlod_error later = {0};
        enum tetlod_status status = tetlodi_record_decode(recorder, &later);
        if (status == TETLOD_OK)
            continue;
        TETLOD_TRY(decode_fields(recorder, error)); // of records before: that failure is the first
        *error = later;
        return status;
    }
    TETLOD_TRY(decode_fields(recorder, error));
    TETLOD_TRY(tetlodi_check_ends(recorder, error));
    if (replay->tets != recorder->most_tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u has fewer tetrahedra than its row says", page);
    return TETLOD_OK;
}

static const struct tetlodi_page *row_of(const struct level *level, const struct part *part)
{
    return &level->cursor->file->index.pages.pages[level->cursor->group->first_page + part->mesh.page];
}

/* Reads the part's frames and decodes them. */
static enum tetlod_status decode_frames(const struct level *level, struct part *part, struct tetlodi_recorder *recorder,
                                        struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_recorder *whole = &cursor->recorder;
    uint32_t count = part->mesh.replay.column_count;
    uint8_t **frames = calloc(count, sizeof *frames);
    enum tetlod_status status = frames ? TETLOD_OK : tetlodi_fail_nomem(error, "a page", count * sizeof *frames);
    for (uint32_t c = 0; c < count && status == TETLOD_OK; c++) {
        size_t size;
        status = tetlodi_read_page_frame(cursor->file, level->number, part->mesh.page, cursor->parts[c], &frames[c],
                                         &size, error);
        if (status == TETLOD_OK)
            tetlodi_decode_start(&recorder->coders[c], cursor->file->index.slowest, frames[c], size);
        else
            part->unread = 1;
    }
    if (status == TETLOD_OK) {
        recorder->labels = whole->labels;
        recorder->max_labels = whole->max_labels;
        tetlodi_page_part_begin(&part->mesh, recorder, whole, row_of(level, part)->vertices, row_of(level, part)->tets);
        status = decode_records(recorder, part->mesh.page, error);
    }
    part->labels = recorder->labels - whole->labels;
    for (uint32_t c = 0; c < count && frames; c++)
        free(frames[c]);
    free(frames);
    return status;
}

/* A page of which a reader has some and not others keeps its tetrahedra in its part of space (SPEC 7.6). */
static enum tetlod_status check_cell(const struct level *level, const struct part *part, struct tetlod_error *error)
{
    const struct tetlodi_replay *replay = &part->mesh.replay;
    const struct tetlodi_cut *tree = level->cursor->group->tree;
    for (uint32_t t = 0; level->coming && t < replay->tets; t++)
        if (tetlodi_page_at_corners(tree, replay->columns[0].values, replay->corners + 4 * (size_t)t) !=
            part->mesh.page)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u has tetrahedra of another one", part->mesh.page);
    return TETLOD_OK;
}

static int decode_part(void *opaque, uint32_t number)
{
    const struct level *level = opaque;
    struct part *part = &level->parts[number];
    struct tetlod_error *error = &part->error;
    struct tetlodi_recorder recorder = {0};
    const struct tetlodi_page *row = row_of(level, part);
    error->status = tetlodi_page_part_gather(&part->mesh, &level->shares, row->vertices, row->tets, level->share)
                        ? TETLOD_OK
                        : tetlodi_no_room(&part->mesh.memory, error);
    if (error->status == TETLOD_OK)
        error->status = tetlodi_recorder_init(&recorder, &part->mesh.replay, error);
    if (error->status == TETLOD_OK)
        error->status = decode_frames(level, part, &recorder, error);
    if (error->status == TETLOD_OK)
        error->status = check_cell(level, part, error);
    part->done = error->status == TETLOD_OK;
    if (part->done)
        tetlodi_page_part_scatter(&part->mesh, &level->shares);
    tetlodi_recorder_fini(&recorder);
    tetlodi_page_part_shrink(&part->mesh);
    return error->status == TETLOD_OK;
}

/* ---- all pages */

static void level_fini(struct level *level)
{
    for (uint32_t i = 0; i < level->part_count; i++)
        tetlodi_page_part_fini(&level->parts[i].mesh);
    free(level->parts);
    tetlodi_page_shares_fini(&level->shares);
}

/* Takes back what a part has put into the mesh. */
static void undo_part(const struct level *level, const struct part *part)
{
    struct tetlodi_replay *whole = &level->cursor->replay;
    const struct tetlodi_page_part *mesh = &part->mesh;
    uint32_t records = mesh->replay.records, end = mesh->first_vertex + row_of(level, part)->vertices;
    for (uint32_t s = mesh->replay.splits; s-- > 0;) {
        uint32_t v = mesh->replay.log[s].vertex, number = page_part_outside(mesh, v);
        whole->stars[number].leaf = 0;
        if (!(mesh->replay.log[s].tets & SPLIT_FIRST))
            continue;
        records--;
        for (uint32_t c = 0; c < whole->column_count; c++)
            tetlodi_column_put(&whole->columns[c], c == 0, number, &mesh->columns[c], records);
    }
    for (size_t i = 0; i < 4 * (size_t)mesh->tet_count; i++) {
        uint32_t *corner = &whole->corners[4 * (size_t)mesh->tets[i / 4] + i % 4];
        while (*corner >= mesh->first_vertex && *corner < end)
            *corner = whole->parents[*corner];
    }
}

static int allocate(struct level *level)
{
    size_t pages = level->cursor->group->page_count;
    level->parts = calloc(pages, sizeof *level->parts);
    return tetlodi_page_shares_init(&level->shares, &level->cursor->replay, pages) && level->parts;
}

/* Where the pages begin that may come: those of the level, behind it; or all of them, behind the levels before. */
static uint32_t first_page(const struct level *level, uint32_t *vertex, uint32_t *tet)
{
    const struct tetlod_cursor *cursor = level->cursor;
    uint32_t root = cursor->file->index.pages.first_level - 1;
    *vertex = level->coming ? cursor->vertices[root] : level->shares.vertices;
    *tet = level->coming ? cursor->tets[root] : level->shares.tets;
    return level->coming ? 0 : cursor->group->first_page;
}

/* Which pages there are to decode, and what each has. */
static void list_parts(struct level *level)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_group *group = cursor->group;
    const struct tetlodi_coming *coming = level->coming;
    uint32_t vertex, tet, p = first_page(level, &vertex, &tet);
    tetlodi_helpers_start(cursor->helpers, find_some, level, (level->shares.tets + TETS_A_TASK - 1) / TETS_A_TASK);
    tetlodi_helpers_wait(cursor->helpers);
    tetlodi_page_shares_sort(&level->shares, cursor->helpers);
    for (; p < group->first_page + group->page_count; p++) {
        const struct tetlodi_page *row = &cursor->file->index.pages.pages[p];
        uint32_t own = p - group->first_page;
        if (coming && !coming->next[p])
            continue;
        if (row->vertices && (!coming || coming->pages[p])) {
            struct tetlodi_page_part *part = &level->parts[level->part_count++].mesh;
            tetlodi_page_part_set(part, &level->shares, own);
            part->first_vertex = vertex;
            part->first_tet = tet;
        }
        vertex += row->vertices;
        tet += row->tets;
    }
}

/* Each tetrahedron comes from a page that its page needs, so that what is taken out later is nobody's. */
static enum tetlod_status check_needed(const struct level *level, struct tetlod_error *error)
{
    const struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_page_table *table = &cursor->file->index.pages;
    const struct tetlodi_group *group = cursor->group;
    uint32_t known_page = TETLOD_NONE, known = TETLOD_NONE;
    for (uint32_t t = 0; level->coming && level->number > table->first_level && t < level->shares.tets; t++) {
        uint32_t page = level->shares.page_of[t], last = cursor->choice->page_of[t];
        if (page >= group->page_count || (page == known_page && last == known))
            continue;
        const struct tetlodi_page *row = &table->pages[group->first_page + page];
        uint32_t i = row->needed_begin, end = i + row->needed_count;
        while (i < end && table->needed[i] != last - group[-1].first_page)
            i++;
        if (i == end)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u needs page %u of the level before, and says not so",
                                page, last - group[-1].first_page);
        known_page = page;
        known = last;
    }
    return TETLOD_OK;
}

/* Of some pages: which tetrahedra were in them last. */
static void remember_pages(const struct level *level)
{
    const struct tetlodi_choice *choice = level->cursor->choice;
    const uint32_t first = level->cursor->group->first_page;
    for (uint32_t t = 0; t < level->shares.tets; t++)
        if (level->shares.page_of[t] < level->cursor->group->page_count)
            choice->page_of[t] = first + level->shares.page_of[t];
    for (uint32_t i = 0; i < level->part_count; i++) {
        const struct tetlodi_page_part *part = &level->parts[i].mesh;
        for (size_t t = part->tet_count; t < part->replay.tets; t++)
            choice->page_of[part->first_tet + (t - part->tet_count)] = first + part->page;
    }
}

/* Room in the log for that of all parts, between what other pages have there. */
static enum tetlod_status open_log(struct level *level, struct tetlodi_log_place *at, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    struct tetlodi_replay *replay = &cursor->replay;
    struct tetlodi_log_place end = {replay->splits, replay->records, replay->label};
    *at = end;
    for (uint32_t i = 0; i < level->part_count; i++) {
        end.split += level->parts[i].mesh.replay.splits;
        end.record += level->parts[i].mesh.replay.records;
        end.label += level->parts[i].mesh.replay.label;
        if (level->coming)
            cursor->choice->logs[cursor->group->first_page + level->parts[i].mesh.page] =
                (struct tetlodi_page_log){level->parts[i].mesh.replay.records, level->parts[i].mesh.replay.label};
    }
    if (!tetlodi_replay_log_room(replay, end.split, end.record, end.label))
        return tetlodi_no_room(&cursor->memory, error);
    if (!level->coming)
        return TETLOD_OK;
    struct tetlodi_moves moves = {0};
    int done = tetlodi_moves_of_log(&moves, cursor, level->coming->next);
    if (done) {
        tetlodi_move_log(cursor, &moves);
        remember_pages(level);
        *at = tetlodi_log_of_root(cursor);
    }
    tetlodi_moves_fini(&moves);
    return done ? TETLOD_OK : tetlodi_fail_nomem(error, "pages in the log", end.label / 8);
}

/* The logs of all parts, each behind those of the pages before it. */
static enum tetlod_status put_logs(struct level *level, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_page_table *table = &cursor->file->index.pages;
    struct tetlodi_recorder *recorder = &cursor->recorder;
    struct tetlodi_log_place at;
    uint32_t vertex, tet, i = 0;
    for (uint32_t k = 0; k < level->part_count; k++)
        recorder->labels += level->parts[k].labels;
    if (recorder->labels > recorder->max_labels)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "its records split larger stars than go with its bytes");
    TETLOD_TRY(open_log(level, &at, error));
    for (uint32_t p = first_page(level, &vertex, &tet); p < table->page_count; p++) {
        const struct tetlodi_page_part *part = &level->parts[i].mesh;
        bool is_part = i < level->part_count && p == cursor->group->first_page + part->page;
        if (!is_part && !(level->coming && level->coming->next[p]))
            continue;
        if (is_part)
            tetlodi_replay_place(&cursor->replay, &part->replay, part->listed, part->listed_count, part->first_vertex,
                                 &at);
        i += is_part;
        vertex += table->pages[p].vertices;
        tet += table->pages[p].tets;
        at.split += table->pages[p].vertices;
        at.record += is_part ? part->replay.records : cursor->choice->logs[p].records;
        at.label += is_part ? part->replay.label : cursor->choice->logs[p].labels;
    }
    tetlodi_replay_set(&cursor->replay, vertex, tet, &at);
    return TETLOD_OK;
}

static enum tetlod_status decode_all(struct level *level, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const uint32_t threads = cursor->file->options.threads;
    list_parts(level);
    TETLOD_TRY(check_needed(level, error));
    level->share = (cursor->memory.most - cursor->memory.used) / (threads ? threads : 1);
    tetlodi_helpers_start(cursor->helpers, decode_part, level, level->part_count);
    tetlodi_helpers_wait(cursor->helpers);
    for (uint32_t i = 0; i < level->part_count; i++) {
        if (level->parts[i].error.status == TETLOD_OK)
            continue;
        cursor->unread = level->parts[i].unread;
        *error = level->parts[i].error;
        return error->status;
    }
    return put_logs(level, error);
}

enum tetlod_status tetlodi_decode_pages(struct tetlod_cursor *cursor, uint32_t level,
                                        const struct tetlodi_coming *coming, struct tetlod_error *error)
{
    struct level all = {.cursor = cursor, .number = level, .coming = coming};
    const struct tetlodi_replay *replay = &cursor->replay;
    uint64_t counted = tetlodi_page_shares_bytes(replay);
    if (!tetlodi_count(&cursor->memory, counted))
        return tetlodi_no_room(&cursor->memory, error);
    enum tetlod_status status = allocate(&all) ? decode_all(&all, error)
                                               : tetlodi_fail_nomem(error, "a level in pages", counted);
    for (uint32_t i = 0; i < all.part_count && status != TETLOD_OK; i++)
        if (all.parts[i].done)
            undo_part(&all, &all.parts[i]);
    level_fini(&all);
    cursor->memory.used -= counted;
    return status;
}
