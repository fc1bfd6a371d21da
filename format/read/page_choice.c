/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Pages that go need no decoding: the log has what their vertices had before, the parents of what they added say which
 * corners their tetrahedra had, and what lies behind moves up. Pages that come are decoded into runs that are opened
 * for them. So the mesh, its numbers and the log are those of its pages, in whichever order they came.
 */
#include "format/read/page_choice.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/cursor.h"
#include "format/read/page_parts.h"
#include "format/read/page_runs.h"

static const struct tetlodi_page_table *table_of(const struct tetlod_cursor *cursor)
{
    return &cursor->file->index.pages;
}

static uint32_t root_of(const struct tetlod_cursor *cursor)
{
    return table_of(cursor)->first_level - 1;
}

/* Any page of a level? */
static bool has_any(const struct tetlod_cursor *cursor, const uint8_t *pages, uint32_t level)
{
    const struct tetlodi_group *group = tetlodi_group_of(table_of(cursor), level);
    return memchr(pages + group->first_page, 1, group->page_count) != NULL;
}

static uint32_t finest_of(const struct tetlod_cursor *cursor, const uint8_t *pages)
{
    uint32_t level = root_of(cursor) + table_of(cursor)->group_count;
    while (level > root_of(cursor) && !has_any(cursor, pages, level))
        level--;
    return level;
}

/* The first page of a level that is wanted and not there, from a page on. */
static uint32_t next_missing(const struct tetlodi_choice *choice, uint32_t page, uint32_t end)
{
    while (page < end && (choice->has[page] || !choice->wanted[page]))
        page++;
    return page;
}

static void find_next(struct tetlod_cursor *cursor)
{
    uint32_t pages = table_of(cursor)->page_count, page = next_missing(cursor->choice, 0, pages);
    cursor->choice->next = page < pages ? tetlodi_level_of_page(table_of(cursor), page) : TETLOD_NONE;
}

/* Levels are what the pages make of them, and the mesh has all that is there. */
static void settle_pages(struct tetlod_cursor *cursor)
{
    const struct tetlodi_page_table *table = table_of(cursor);
    const struct tetlodi_choice *choice = cursor->choice;
    struct tetlodi_log_place end = tetlodi_log_of_root(cursor);
    uint32_t level = root_of(cursor);
    for (uint32_t g = 0; g < table->group_count; g++, level++) {
        cursor->vertices[level + 1] = cursor->vertices[level];
        cursor->tets[level + 1] = cursor->tets[level];
        for (uint32_t i = 0, p = table->groups[g].first_page; i < table->groups[g].page_count; i++, p++) {
            if (!choice->has[p])
                continue;
            cursor->vertices[level + 1] += table->pages[p].vertices;
            cursor->tets[level + 1] += table->pages[p].tets;
            end.split += table->pages[p].vertices;
            end.record += choice->logs[p].records;
            end.label += (size_t)choice->logs[p].labels;
        }
        cursor->records[level + 1] = (uint32_t)end.record;
    }
    cursor->level = cursor->decoded = finest_of(cursor, choice->has);
    tetlodi_replay_set(&cursor->replay, cursor->vertices[level], cursor->tets[level], &end);
    cursor->starless = 1;
    find_next(cursor);
}

/* ---- pages go */

struct going {
    struct tetlod_cursor *cursor;
    const uint8_t *next;
    uint32_t *up;                      /* [vertex] of a page that goes: what it was split from; of others themselves */
    struct { uint32_t vertex, record; } *begins; /* [page] */
};

static bool goes(const struct going *going, uint32_t page)
{
    return page < NOT_THERE && going->cursor->choice->has[page] && !going->next[page];
}

/* Any page of a level? */
static bool any_goes(const struct going *going, uint32_t level)
{
    const struct tetlodi_group *group = tetlodi_group_of(table_of(going->cursor), level);
    uint32_t i = 0;
    while (i < group->page_count && !goes(going, group->first_page + i))
        i++;
    return i < group->page_count;
}

static void find_begins(struct going *going)
{
    const struct tetlod_cursor *cursor = going->cursor;
    uint32_t vertex = cursor->vertices[root_of(cursor)], record = cursor->records[root_of(cursor)];
    for (uint32_t p = 0; p < table_of(cursor)->page_count; p++) {
        going->begins[p].vertex = vertex;
        going->begins[p].record = record;
        vertex += cursor->choice->has[p] ? table_of(cursor)->pages[p].vertices : 0;
        record += cursor->choice->has[p] ? cursor->choice->logs[p].records : 0;
    }
    for (uint32_t v = 0; v < cursor->replay.vertices; v++)
        going->up[v] = v;
}

/* What vertices had before a page, none of whose tetrahedra is in another one that is still there. */
static void undo_page(const struct going *going, uint32_t page)
{
    struct tetlodi_replay *replay = &going->cursor->replay;
    uint32_t first = going->begins[page].vertex, end = first + table_of(going->cursor)->pages[page].vertices;
    uint32_t record = going->begins[page].record + going->cursor->choice->logs[page].records;
    for (uint32_t v = end; v-- > first;) {
        const struct tetlodi_split *split = &replay->log[v - (replay->vertices - replay->splits)];
        replay->stars[split->vertex].leaf = 0; // it splits
        if (split->tets & SPLIT_FIRST)
            tetlodi_replay_exchange(replay, split->vertex, --record);
    }
    for (uint32_t v = first; v < end; v++)
        going->up[v] = going->up[replay->parents[v]];
}

/* The same of a level's pages, and what their tetrahedra were then. */
static void undo_pages(const struct going *going, uint32_t level)
{
    struct tetlod_cursor *cursor = going->cursor;
    const struct tetlodi_group *group = tetlodi_group_of(table_of(cursor), level);
    const bool is_first = level - 1 == root_of(cursor);
    struct tetlodi_page_finder finder = tetlodi_page_finder(is_first ? NULL : group[-1].tree);
    for (uint32_t p = group->first_page; p < group->first_page + group->page_count; p++)
        if (goes(going, p))
            undo_page(going, p);
    for (uint32_t t = 0; t < cursor->replay.tets; t++) {
        uint32_t *corners = cursor->replay.corners + 4 * (size_t)t, *page = &cursor->choice->page_of[t];
        if (*page - group->first_page >= group->page_count || !goes(going, *page))
            continue;
        for (int c = 0; c < 4; c++)
            corners[c] = going->up[corners[c]];
        *page = TETLOD_NONE;
        if (!is_first)
            *page = group[-1].first_page +
                    tetlodi_page_at_corners(&finder, cursor->columns[0].values, corners);
    }
}

/* Pages that are not among `next` go. */
static enum tetlod_status give_back(struct tetlod_cursor *cursor, const uint8_t *next, struct tetlod_error *error)
{
    const size_t vertices = cursor->replay.all_vertices, pages = table_of(cursor)->page_count;
    struct going going = {.cursor = cursor, .next = next};
    struct tetlodi_moves moves = {0};
    uint32_t level = cursor->level;
    enum tetlod_status status = tetlodi_cursor_go_to(cursor, cursor->decoded, error);
    going.up = malloc((vertices + 1) * sizeof *going.up);
    going.begins = malloc(pages * sizeof *going.begins);
    if (status == TETLOD_OK && !(going.up && going.begins && tetlodi_moves_of_mesh(&moves, cursor, next) &&
                                 tetlodi_moves_of_log(&moves, cursor, next)))
        status = tetlodi_fail_nomem(error, "pages that go", vertices * 16);
    if (status == TETLOD_OK) {
        find_begins(&going);
        for (uint32_t l = cursor->decoded; l > root_of(cursor); l--)
            if (any_goes(&going, l))
                undo_pages(&going, l);
        tetlodi_move_mesh(cursor, &moves, going.up);
        tetlodi_move_log(cursor, &moves);
        memcpy(cursor->choice->has, next, pages);
        settle_pages(cursor);
        level = level < cursor->decoded ? level : cursor->decoded;
        status = tetlodi_cursor_go_to(cursor, level, error);
        cursor->level = level;
    }
    tetlodi_moves_fini(&moves);
    free(going.up);
    free(going.begins);
    return status;
}

/* ---- pages come */

/* Some of the pages of the level that come next, one at least: those that add no more than *vertices, and then no
 * other one. */
static void choose_coming(struct tetlod_cursor *cursor, uint32_t *vertices, uint8_t *pages, uint8_t *next)
{
    const struct tetlodi_choice *choice = cursor->choice;
    const struct tetlodi_group *group = tetlodi_group_of(table_of(cursor), choice->next);
    uint32_t end = group->first_page + group->page_count, left = *vertices;
    memcpy(next, choice->has, table_of(cursor)->page_count);
    for (uint32_t p = next_missing(choice, group->first_page, end), first = p; p < end;
         p = next_missing(choice, p + 1, end)) {
        uint32_t adds = table_of(cursor)->pages[p].vertices;
        if (p > first && adds > left)
            break;
        pages[p] = next[p] = 1;
        left -= adds < left ? adds : left;
    }
    *vertices = left < *vertices ? left : *vertices - 1;
}

/* Counts what pages add to a level and to those behind it, and makes room for all. */
static enum tetlod_status count_coming(struct tetlod_cursor *cursor, uint32_t level, const uint8_t *pages,
                                       struct tetlod_error *error)
{
    const struct tetlodi_page_table *table = table_of(cursor);
    const struct tetlodi_group *group = tetlodi_group_of(table, level);
    struct tetlodi_replay *replay = &cursor->replay;
    uint64_t vertices = replay->vertices, tets = replay->tets;
    for (uint32_t i = 0, p = group->first_page; i < group->page_count; i++, p++) {
        if (!pages[p])
            continue;
        vertices += table->pages[p].vertices;
        tets += table->pages[p].tets;
        for (uint32_t c = 0; c < replay->column_count; c++)
            cursor->columns[c].frame_bytes += tetlodi_cursor_frame(cursor, level, i, c);
    }
    TETLOD_TRY(tetlodi_check_held(level, vertices, tets, error));
    TETLOD_TRY(tetlodi_cursor_room(cursor, (uint32_t)vertices, (uint32_t)tets, error));
    if (!tetlodi_replay_log_room(replay, replay->splits + (size_t)(vertices - replay->vertices), replay->records,
                                 replay->label) ||
        !TETLODI_ROOM(&cursor->memory, cursor->choice->page_of, cursor->choice->page_of_capacity, (size_t)tets))
        return tetlodi_no_room(&cursor->memory, error);
    tetlodi_level_begin(&cursor->recorder, (uint32_t)vertices, (uint32_t)tets);
    return TETLOD_OK;
}

/* On failure all is as before. */
static enum tetlod_status decode_coming(struct tetlod_cursor *cursor, uint32_t level,
                                        const struct tetlodi_coming *coming, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    struct tetlodi_moves moves = {0};
    TETLOD_TRY(count_coming(cursor, level, coming->pages, error));
    for (uint32_t t = 0; cursor->decoded == root_of(cursor) && t < replay->tets; t++)
        cursor->choice->page_of[t] = TETLOD_NONE;
    if (!tetlodi_moves_of_mesh(&moves, cursor, coming->next)) {
        tetlodi_moves_fini(&moves);
        return tetlodi_fail_nomem(error, "pages that come", replay->vertices * (uint64_t)4);
    }
    tetlodi_move_mesh(cursor, &moves, NULL);
    const struct tetlodi_levels one = {level, 1, {cursor->recorder.max_labels}};
    enum tetlod_status status = tetlodi_decode_pages(cursor, &one, coming, error);
    if (status != TETLOD_OK) {
        tetlodi_moves_turn(&moves);
        tetlodi_move_mesh(cursor, &moves, NULL);
    }
    tetlodi_moves_fini(&moves);
    return status;
}

/* Decodes some pages of the first level of which any are to come, as far as *vertices allows. The root is decoded, and
 * the cursor at the log's end. */
static enum tetlod_status bring(struct tetlod_cursor *cursor, uint32_t *vertices, struct tetlod_error *error)
{
    struct tetlodi_choice *choice = cursor->choice;
    const uint32_t pages = table_of(cursor)->page_count, level = choice->next;
    struct tetlod_error inner = {0};
    if (cursor->broken != TETLOD_OK) {
        if (error)
            *error = cursor->damage;
        return cursor->broken;
    }
    TETLOD_TRY(tetlodi_cursor_go_to(cursor, cursor->decoded, error));
    uint8_t *coming = calloc(2, pages);
    if (!coming)
        return tetlodi_fail_nomem(error, "a set of pages", 2 * (uint64_t)pages);
    if (cursor->decoded == root_of(cursor))
        choice->root_labels = cursor->replay.label;
    choose_coming(cursor, vertices, coming, coming + pages);
    const struct tetlodi_coming both = {coming, coming + pages};
    cursor->group = tetlodi_group_of(table_of(cursor), level);
    cursor->unread = 0;
    enum tetlod_status status = decode_coming(cursor, level, &both, &inner);
    if (status == TETLOD_OK) {
        memcpy(choice->has, both.next, pages);
        settle_pages(cursor);
    } else {
        status = tetlodi_cursor_fail(cursor, level, status, &inner, error);
    }
    free(coming);
    return status;
}

/* ---- others */

/* The levels before those in pages, as far as they are decoded. */
static enum tetlod_status back_to_root(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    uint32_t root = root_of(cursor), level = cursor->level < root ? cursor->level : root;
    if (cursor->decoded < root)
        return TETLOD_OK;
    TETLOD_TRY(tetlodi_cursor_go_to(cursor, root, error));
    tetlodi_cursor_forget(cursor);
    cursor->decoded = root;
    cursor->level = level;
    return tetlodi_cursor_go_to(cursor, level, error);
}

static enum tetlod_status begin_choice(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const size_t pages = table_of(cursor)->page_count;
    struct tetlodi_choice *choice = calloc(1, sizeof *choice);
    cursor->choice = choice;
    if (choice) {
        *choice = (struct tetlodi_choice){.choose = tetlodi_cursor_choose, .bring = bring};
        choice->has = calloc(pages, 1);
        choice->wanted = calloc(pages, 1);
        choice->logs = calloc(pages, sizeof *choice->logs);
    }
    if (choice && choice->has && choice->wanted && choice->logs)
        return TETLOD_OK;
    tetlodi_choice_free(cursor);
    return tetlodi_fail_nomem(error, "a set of pages", pages * (2 + sizeof *choice->logs));
}

enum tetlod_status tetlodi_cursor_choose(struct tetlod_cursor *cursor, const uint8_t *pages,
                                         struct tetlod_error *error)
{
    struct tetlodi_choice *choice = cursor->choice;
    if (!choice != !pages) // some now and all before, or the other way round
        TETLOD_TRY(back_to_root(cursor, error));
    cursor->broken = cursor->decoded < root_of(cursor) ? cursor->broken : TETLOD_OK;
    if (!pages) {
        tetlodi_choice_free(cursor);
        return TETLOD_OK;
    }
    if (!choice)
        TETLOD_TRY(begin_choice(cursor, error));
    choice = cursor->choice;
    uint32_t count = table_of(cursor)->page_count, p = 0;
    uint8_t *next = malloc(count);
    if (!next)
        return tetlodi_fail_nomem(error, "a set of pages", count);
    for (uint32_t i = 0; i < count; i++)
        next[i] = choice->has[i] & pages[i];
    while (p < count && next[p] == choice->has[p])
        p++;
    enum tetlod_status status = p < count ? give_back(cursor, next, error) : TETLOD_OK;
    free(next);
    if (status != TETLOD_OK)
        return status;
    memcpy(choice->wanted, pages, count);
    choice->finest = finest_of(cursor, pages);
    find_next(cursor);
    return TETLOD_OK;
}
