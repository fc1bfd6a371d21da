/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a mesh, and the pages of its next level. 1. The page of each tetrahedron, and who has each vertex: one page, or
 * several (a seam). 2. Each page, on any thread: a mesh of its tetrahedra in numbers of its own, its records, and the
 * result put back where it belongs; what it adds has places that the table of pages says before. Where the next level
 * has the same tree, its page is decoded behind it before both are put back. 3. The logs of all pages, one after the
 * other, between those of pages that were there before. Numbers inside a page are in the order of those outside, which
 * is all that a record depends on.
 */
#include "format/read/page_parts.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/record_fields.h"
#include "format/fail.h"
#include "format/read/page_runs.h"

enum { RECORDS = 96 }; /* whose fields are decoded in one go, as on one thread */

struct part {
    struct tetlodi_page_part mesh;
    struct tetlodi_log_place ends[MAX_ALIKE]; /* of its log, at each level's end */
    uint64_t labels[MAX_ALIKE];               /* that are counted of each */
    int wanted; /* it adds something */
    int unread; /* its frames could not be read */
    int done;   /* it has been put back */
    struct tetlod_error error;
};

/* Levels of one tree, mostly one or two. */
struct level {
    struct tetlod_cursor *cursor;
    uint32_t number, count;              /* the first; how many */
    const struct tetlodi_coming *coming; /* some of the pages; NULL: all */
    uint64_t max_labels[MAX_ALIKE];
    struct tetlodi_page_shares shares;
    struct part *parts;                  /* [page] */
    uint64_t share;                      /* of memory that a part may take */
};

/* ---- what pages have */

/* The page of a tetrahedron that is in one of this level: the level before has the last one that it was in. */
static uint32_t page_of_tet(const struct level *level, struct tetlodi_page_finder *finder, uint32_t t)
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
    uint32_t page = tetlodi_page_at_corners(finder, cursor->columns[0].values, corners);
    return !level->coming || level->coming->pages[group->first_page + page] ? page : TETLOD_NONE;
}

static int find_some(void *opaque, uint32_t task)
{
    const struct level *level = opaque;
    struct tetlodi_page_finder finder = tetlodi_page_finder(level->cursor->group->tree);
    for (uint32_t t = tetlodi_task_begin(task), end = tetlodi_task_end(task, level->shares.tets); t < end; t++)
        level->shares.page_of[t] = page_of_tet(level, &finder, t);
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

/* The row of a part's page in the level's k-th group. */
static const struct tetlodi_page *row_of(const struct level *level, uint32_t page, uint32_t k)
{
    return &level->cursor->file->index.pages.pages[level->cursor->group[k].first_page + page];
}

static void free_frames(uint8_t **frames, uint32_t count)
{
    for (uint32_t c = 0; c < count && frames; c++)
        free(frames[c]);
    free(frames);
}

/* Reads the frames of the part's page of the k-th level and decodes them. */
static enum tetlod_status decode_frames(const struct level *level, struct part *part, uint32_t k,
                                        struct tetlodi_recorder *recorder, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_page *row = row_of(level, part->mesh.page, k);
    const uint32_t count = part->mesh.replay.column_count;
    uint8_t **frames = calloc(count, sizeof *frames);
    enum tetlod_status status = frames ? TETLOD_OK : tetlodi_fail_nomem(error, "a page", count * sizeof *frames);
    for (uint32_t c = 0; c < count && status == TETLOD_OK; c++) {
        size_t size;
        status = tetlodi_read_page_frame(cursor->file, level->number + k, part->mesh.page, cursor->parts[c], &frames[c],
                                         &size, error);
        if (status == TETLOD_OK)
            tetlodi_decode_start(&recorder->coders[c], cursor->file->index.slowest, frames[c], size);
        else
            part->unread = 1;
    }
    if (status == TETLOD_OK) {
        tetlodi_page_part_begin(&part->mesh, recorder, &cursor->recorder, row->vertices, row->tets);
        status = decode_records(recorder, part->mesh.page, error);
    }
    free_frames(frames, count);
    return status;
}

/* A page of which a reader has some and not others, or that of the next level besides, keeps its tetrahedra in its part
 * of space (SPEC 7.6). */
static enum tetlod_status check_cell(const struct level *level, const struct part *part, struct tetlod_error *error)
{
    const struct tetlodi_replay *replay = &part->mesh.replay;
    struct tetlodi_page_finder finder = tetlodi_page_finder(level->cursor->group->tree);
    for (uint32_t t = 0; t < replay->tets; t++)
        if (tetlodi_page_at_corners(&finder, replay->columns[0].values, replay->corners + 4 * (size_t)t) !=
            part->mesh.page)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u has tetrahedra of another one", part->mesh.page);
    return TETLOD_OK;
}

/* The part's pages, of one level after the other. */
static enum tetlod_status decode_levels(const struct level *level, struct part *part, struct tetlodi_recorder *recorder,
                                        struct tetlod_error *error)
{
    const struct tetlodi_replay *replay = &part->mesh.replay;
    recorder->labels = level->cursor->recorder.labels;
    for (uint32_t k = 0; k < level->count; k++) {
        const uint64_t labels = recorder->labels;
        recorder->max_labels = level->max_labels[k];
        if (k)
            tetlodi_page_part_next(&part->mesh);
        if (row_of(level, part->mesh.page, k)->vertices)
            TETLOD_TRY(decode_frames(level, part, k, recorder, error));
        part->labels[k] = recorder->labels - labels;
        part->ends[k] = (struct tetlodi_log_place){replay->splits, replay->records, replay->label};
        if (level->coming || k + 1 < level->count)
            TETLOD_TRY(check_cell(level, part, error));
    }
    return TETLOD_OK;
}

static int decode_part(void *opaque, uint32_t number)
{
    const struct level *level = opaque;
    struct part *part = &level->parts[number];
    struct tetlod_error *error = &part->error;
    struct tetlodi_recorder recorder = {0};
    uint32_t vertices = 0, tets = 0;
    if (!part->wanted)
        return 1;
    for (uint32_t k = 0; k < level->count; k++) {
        vertices += row_of(level, number, k)->vertices;
        tets += row_of(level, number, k)->tets;
    }
    error->status = tetlodi_page_part_gather(&part->mesh, &level->shares, vertices, tets, level->share)
                        ? TETLOD_OK
                        : tetlodi_no_room(&part->mesh.memory, error);
    if (error->status == TETLOD_OK)
        error->status = tetlodi_recorder_init(&recorder, &part->mesh.replay, error);
    if (error->status == TETLOD_OK)
        error->status = decode_levels(level, part, &recorder, error);
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
    for (uint32_t i = 0; level->parts && i < level->cursor->group->page_count; i++)
        tetlodi_page_part_fini(&level->parts[i].mesh);
    free(level->parts);
    tetlodi_page_shares_fini(&level->shares);
}

/* Does a part, as it has been put back, have the vertex as one that it adds? */
static bool adds_vertex(const struct level *level, const struct part *part, uint32_t vertex)
{
    for (uint32_t k = 0; k < level->count; k++)
        if (vertex - part->mesh.runs[k].first_vertex < row_of(level, part->mesh.page, k)->vertices)
            return true;
    return false;
}

/* Takes back what a part has put into the mesh. */
static void undo_part(const struct level *level, const struct part *part)
{
    struct tetlodi_replay *whole = &level->cursor->replay;
    const struct tetlodi_page_part *mesh = &part->mesh;
    uint32_t records = mesh->replay.records;
    for (uint32_t s = mesh->replay.splits; s-- > 0;) {
        uint32_t vertex = mesh->replay.log[s].vertex;
        whole->stars[vertex].leaf = 0;
        if (!(mesh->replay.log[s].tets & SPLIT_FIRST))
            continue;
        records--;
        for (uint32_t c = 0; c < whole->column_count; c++)
            tetlodi_column_put(&whole->columns[c], c == 0, vertex, &mesh->columns[c], records);
    }
    for (size_t i = 0; i < 4 * (size_t)mesh->tet_count; i++) {
        uint32_t *corner = &whole->corners[4 * (size_t)mesh->tets[i / 4] + i % 4];
        while (adds_vertex(level, part, *corner))
            *corner = whole->parents[*corner];
    }
}

static int allocate(struct level *level)
{
    size_t pages = level->cursor->group->page_count;
    level->parts = calloc(pages, sizeof *level->parts);
    return tetlodi_page_shares_init(&level->shares, &level->cursor->replay, pages) && level->parts;
}

/* Pages that there are or will be, of all: of some of them from the root on, else from the level on. */
static uint32_t first_page(const struct level *level)
{
    return level->coming ? 0 : level->cursor->group->first_page;
}

static uint32_t end_page(const struct level *level)
{
    const struct tetlodi_group *last = &level->cursor->group[level->count - 1];
    return level->coming ? level->cursor->file->index.pages.page_count : last->first_page + last->page_count;
}

static bool is_there(const struct level *level, uint32_t page)
{
    return !level->coming || level->coming->next[page];
}

/* The part to which a page comes that adds something, and of which of the level's groups it is; NULL: none does. */
static struct part *part_of(const struct level *level, uint32_t page, uint32_t *k)
{
    const struct tetlodi_group *group = level->cursor->group;
    for (*k = 0; *k < level->count; ++*k)
        if (page - group[*k].first_page < group[*k].page_count)
            break;
    if (*k == level->count || !level->cursor->file->index.pages.pages[page].vertices ||
        (level->coming && !level->coming->pages[page]))
        return NULL;
    return &level->parts[page - group[*k].first_page];
}

/* What each part has, and where what it adds will be. */
static void list_parts(struct level *level)
{
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_page *pages = cursor->file->index.pages.pages;
    uint32_t root = cursor->file->index.pages.first_level - 1, k;
    uint32_t vertex = level->coming ? cursor->vertices[root] : level->shares.vertices;
    uint32_t tet = level->coming ? cursor->tets[root] : level->shares.tets;
    for (uint32_t page = 0; page < cursor->group->page_count; page++)
        tetlodi_page_part_set(&level->parts[page].mesh, &level->shares, page);
    for (uint32_t p = first_page(level); p < end_page(level); p++) {
        struct part *part = part_of(level, p, &k);
        if (!is_there(level, p))
            continue;
        if (part) {
            part->wanted = 1;
            part->mesh.runs[k].first_vertex = vertex;
            part->mesh.runs[k].first_tet = tet;
        }
        vertex += pages[p].vertices;
        tet += pages[p].tets;
    }
}

/* What each page has of the mesh. */
static void share_out(struct level *level)
{
    struct tetlodi_helpers *helpers = level->cursor->helpers;
    tetlodi_helpers_share(helpers, find_some, level, level->shares.tets);
    tetlodi_page_shares_sort(&level->shares, helpers);
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
    const struct tetlodi_group *group = level->cursor->group;
    for (uint32_t t = 0; t < level->shares.tets; t++)
        if (level->shares.page_of[t] < group->page_count)
            choice->page_of[t] = group->first_page + level->shares.page_of[t];
    for (uint32_t page = 0; page < group->page_count; page++) {
        const struct part *part = &level->parts[page];
        for (uint32_t i = 0; part->wanted && i < row_of(level, page, 0)->tets; i++)
            choice->page_of[part->mesh.runs->first_tet + i] = group->first_page + page;
    }
}

/* Room in the log for that of all parts, between what other pages have there. */
static enum tetlod_status open_log(struct level *level, struct tetlodi_log_place *at, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    struct tetlodi_replay *replay = &cursor->replay;
    struct tetlodi_log_place end = {replay->splits, replay->records, replay->label};
    *at = end;
    for (uint32_t page = 0; page < cursor->group->page_count; page++) {
        const struct part *part = &level->parts[page];
        const struct tetlodi_replay *added = &part->mesh.replay;
        end.split += added->splits;
        end.record += added->records;
        end.label += added->label;
        if (level->coming && part->wanted)
            cursor->choice->logs[cursor->group->first_page + page] =
                (struct tetlodi_page_log){added->records, added->label};
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

/* Are the labels of each level within what goes with its bytes? */
static enum tetlod_status count_labels(const struct level *level, uint64_t *out, struct tetlod_error *error)
{
    uint64_t labels = level->cursor->recorder.labels;
    for (uint32_t k = 0; k < level->count; k++) {
        for (uint32_t page = 0; page < level->cursor->group->page_count; page++)
            labels += level->parts[page].labels[k];
        if (labels > level->max_labels[k])
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "its records split larger stars than go with its bytes");
    }
    *out = labels;
    return TETLOD_OK;
}

/* The logs of all parts, each behind those of the pages before it. */
static enum tetlod_status put_logs(struct level *level, struct tetlod_error *error)
{
    static const struct tetlodi_log_place begin = {0, 0, 0};
    struct tetlod_cursor *cursor = level->cursor;
    const struct tetlodi_page *pages = cursor->file->index.pages.pages;
    struct tetlodi_log_place at;
    uint64_t labels = 0;
    uint32_t k, last = level->number + level->count - 1;
    TETLOD_TRY(count_labels(level, &labels, error));
    TETLOD_TRY(open_log(level, &at, error));
    for (uint32_t p = first_page(level); p < end_page(level); p++) {
        const struct part *part = part_of(level, p, &k);
        if (!is_there(level, p))
            continue;
        if (part) {
            const struct tetlodi_log_place *from = k ? &part->ends[k - 1] : &begin, *to = &part->ends[k];
            tetlodi_replay_place(&cursor->replay, &at, &part->mesh.replay, from, to);
            at.record += to->record - from->record;
            at.label += to->label - from->label;
        } else if (level->coming) {
            at.record += cursor->choice->logs[p].records;
            at.label += cursor->choice->logs[p].labels;
        }
        at.split += pages[p].vertices;
        if (k < level->count) // the last page counts
            cursor->records[level->number + k] = (uint32_t)at.record;
    }
    cursor->recorder.labels = labels;
    tetlodi_replay_set(&cursor->replay, level->coming ? cursor->replay.vertices : cursor->vertices[last],
                       level->coming ? cursor->replay.tets : cursor->tets[last], &at);
    return TETLOD_OK;
}

static enum tetlod_status decode_all(struct level *level, struct tetlod_error *error)
{
    struct tetlod_cursor *cursor = level->cursor;
    const uint32_t threads = cursor->file->options.threads;
    share_out(level);
    list_parts(level);
    TETLOD_TRY(check_needed(level, error));
    level->share = (cursor->memory.most - cursor->memory.used) / (threads ? threads : 1);
    tetlodi_helpers_start(cursor->helpers, decode_part, level, cursor->group->page_count);
    tetlodi_helpers_wait(cursor->helpers);
    for (uint32_t page = 0; page < cursor->group->page_count; page++) {
        const struct part *part = &level->parts[page];
        if (part->error.status == TETLOD_OK)
            continue;
        cursor->unread = part->unread;
        *error = part->error;
        return error->status;
    }
    return put_logs(level, error);
}

enum tetlod_status tetlodi_decode_pages(struct tetlod_cursor *cursor, const struct tetlodi_levels *levels,
                                        const struct tetlodi_coming *coming, struct tetlod_error *error)
{
    struct level level = {.cursor = cursor, .number = levels->first, .count = levels->count, .coming = coming};
    uint64_t counted = tetlodi_page_shares_bytes(&cursor->replay);
    memcpy(level.max_labels, levels->max_labels, sizeof level.max_labels);
    if (!tetlodi_count(&cursor->memory, counted))
        return tetlodi_no_room(&cursor->memory, error);
    enum tetlod_status status = allocate(&level) ? decode_all(&level, error)
                                                 : tetlodi_fail_nomem(error, "a level in pages", counted);
    for (uint32_t page = 0; status != TETLOD_OK && level.parts && page < cursor->group->page_count; page++)
        if (level.parts[page].done)
            undo_part(&level, &level.parts[page]);
    level_fini(&level);
    cursor->memory.used -= counted;
    return status;
}
