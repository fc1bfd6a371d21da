/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A cursor decodes each level once, in order, because what the coder has learned carries on from level to level. What
 * is decoded stays in the replay's log, so that going down and up again costs no decoding.
 */
#include "format/read/cursor.h"

#include <stdlib.h>
#include <string.h>

#include "format/coding/base.h"
#include "format/coding/record_fields.h"
#include "format/coding/tail.h"
#include "format/fail.h"
#include "format/read/page_parts.h"

/* Records whose fields are decoded in one go: enough that waking helpers costs little, few enough for the cache. */
enum { FIELD_RECORDS = 96 };

static void free_frames(struct tetlod_cursor *cursor)
{
    for (uint32_t c = 0; c < cursor->replay.column_count && cursor->frames; c++)
        free(cursor->frames[c]);
    free(cursor->frames);
    cursor->frames = NULL;
    cursor->memory.used -= cursor->frame_bytes;
    cursor->frame_bytes = 0;
}

/* What decoding a level needs; of a level that failed, also what fields were to be decoded from. */
static void end_level(struct tetlod_cursor *cursor)
{
    struct tetlodi_recorder *recorder = &cursor->recorder;
    for (uint32_t c = 0; c < cursor->replay.column_count && recorder->coders; c++)
        recorder->coders[c].bad = 0;
    for (int i = 0; i < 2; i++)
        tetlodi_field_log_clear(&recorder->logs[i]);
    free_frames(cursor);
    tetlodi_page_lists_fini(&cursor->lists, &cursor->memory);
    cursor->decoding_level = 0;
}

/* Does task(cursor, 0 ... columns - 1), with the helpers that there are: tasks say in cursor->errors what went wrong.
 * The first column's failure counts: a source that has failed is not asked again. */
static enum tetlod_status for_columns(struct tetlod_cursor *cursor, tetlodi_task *task, struct tetlod_error *error)
{
    uint32_t count = cursor->replay.column_count;
    for (uint32_t c = 0; c < count; c++)
        cursor->errors[c].status = TETLOD_OK;
    tetlodi_helpers_start(cursor->helpers, task, cursor, count);
    tetlodi_helpers_wait(cursor->helpers);
    for (uint32_t c = 0; c < count; c++)
        if (cursor->errors[c].status != TETLOD_OK) {
            if (error)
                *error = cursor->errors[c];
            return cursor->errors[c].status;
        }
    return TETLOD_OK;
}

/* Reads a column's frame of the level that is to be decoded, and starts the coder on it. */
static int load_frame(void *opaque, uint32_t column)
{
    struct tetlod_cursor *cursor = opaque;
    struct tetlod_error *error = &cursor->errors[column];
    size_t size;
    uint32_t level = cursor->loading, page = cursor->loading_page, part = cursor->parts[column];
    uint8_t **out = &cursor->frames[column];
    error->status = page == TETLOD_NONE ? tetlodi_read_frame(cursor->file, level, part, out, &size, error)
                                        : tetlodi_read_page_frame(cursor->file, level, page, part, out, &size, error);
    if (error->status == TETLOD_OK)
        tetlodi_decode_start(&cursor->recorder.coders[column], cursor->file->index.slowest, cursor->frames[column],
                             size);
    return error->status == TETLOD_OK;
}

uint64_t tetlodi_cursor_frame(const struct tetlod_cursor *cursor, uint32_t level, uint32_t page, uint32_t column)
{
    const struct tetlodi_index *index = &cursor->file->index;
    uint32_t fields = index->info.field_count, part = cursor->parts[column];
    if (page == TETLOD_NONE)
        return index->frames[level * (1 + (size_t)fields) + part].size;
    return tetlodi_page_frame(&index->pages, fields, tetlodi_group_of(&index->pages, level), page, part)->size;
}

/* Reads the frames of the selected parts, of a level or of one of its pages, and starts the coders on them. They are
 * kept until it is decoded. */
static enum tetlod_status load_frames(struct tetlod_cursor *cursor, uint32_t level, uint32_t page,
                                      struct tetlod_error *error)
{
    uint32_t count = cursor->replay.column_count;
    enum tetlod_status status = TETLOD_OK;
    free_frames(cursor);
    cursor->frames = calloc(count, sizeof *cursor->frames);
    if (!cursor->frames)
        return tetlodi_fail_nomem(error, "a level", count * sizeof *cursor->frames);
    for (uint32_t c = 0; c < count && status == TETLOD_OK; c++) {
        uint64_t stored = tetlodi_cursor_frame(cursor, level, page, c);
        if (tetlodi_count(&cursor->memory, stored))
            cursor->frame_bytes += stored;
        else
            status = tetlodi_no_room(&cursor->memory, error);
    }
    cursor->loading = level;
    cursor->loading_page = page;
    if (status == TETLOD_OK)
        status = for_columns(cursor, load_frame, error);
    cursor->unread = status != TETLOD_OK;
    if (status != TETLOD_OK)
        free_frames(cursor);
    return status;
}

static enum tetlod_status check_ends(const struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    return tetlodi_check_ends(&cursor->recorder, error);
}

enum tetlod_status tetlodi_cursor_room(struct tetlod_cursor *cursor, uint32_t vertices, uint32_t tets,
                                       struct tetlod_error *error)
{
    int done = tetlodi_replay_room(&cursor->replay, vertices, tets);
    for (uint32_t c = 0; c < cursor->replay.column_count && done; c++)
        done = tetlodi_column_room(&cursor->columns[c], &cursor->memory, vertices, 0);
    return done ? TETLOD_OK : tetlodi_no_room(&cursor->memory, error);
}

/* What a level will have, and the bytes of the frames that it is decoded from: once for each. ERR_LIMIT. */
static enum tetlod_status count_level(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    const struct tetlod_level *row = &cursor->file->index.info.levels[level];
    uint64_t vertices = row->vertices, tets = row->tets;
    for (uint32_t c = 0; c < cursor->replay.column_count; c++)
        cursor->columns[c].frame_bytes += tetlodi_cursor_frame(cursor, level, TETLOD_NONE, c);
    TETLOD_TRY(tetlodi_check_held(level, vertices, tets, error));
    cursor->vertices[level] = (uint32_t)vertices;
    cursor->tets[level] = (uint32_t)tets;
    return TETLOD_OK;
}

static enum tetlod_status decode_base(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    struct tetlodi_recorder *recorder = &cursor->recorder;
    TETLOD_TRY(count_level(cursor, 0, error));
    TETLOD_TRY(tetlodi_cursor_room(cursor, cursor->vertices[0], cursor->tets[0], error));
    TETLOD_TRY(tetlodi_base_connectivity(recorder, cursor->vertices[0], cursor->tets[0], NULL, error));
    TETLOD_TRY(tetlodi_base_column(replay, cursor->columns, recorder->coders, recorder->models->corner, NULL, error));
    for (uint32_t c = 1; c < replay->column_count; c++) {
        struct tetlodi_field_models *models = &recorder->field_models[c - 1];
        tetlodi_copies_code(&recorder->coders[c], models, cursor->columns[c].components);
        TETLOD_TRY(tetlodi_base_column(replay, &cursor->columns[c], &recorder->coders[c], &models->corner,
                                       models->copied, error));
    }
    return tetlodi_replay_base(replay) ? TETLOD_OK : tetlodi_no_room(&cursor->memory, error);
}

/* Whole levels in pages are decoded by all helpers, a part of one by this thread. */
static bool decodes_pages_at_once(const struct tetlod_cursor *cursor, uint32_t most)
{
    return TETLODI_THREADS && cursor->group && most == UINT32_MAX && !cursor->recorder.paged;
}

enum tetlod_status tetlodi_cursor_stars(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (cursor->starless && !tetlodi_replay_restar(&cursor->replay))
        return tetlodi_no_room(&cursor->memory, error);
    cursor->starless = 0;
    return TETLOD_OK;
}

/* Which page each tetrahedron is in, and what vertices pages have. */
static enum tetlod_status list_pages(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    TETLOD_TRY(tetlodi_cursor_stars(cursor, error));
    if (!tetlodi_page_lists_make(&cursor->lists, &cursor->replay, cursor->group))
        return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
}

static void uncount_level(struct tetlod_cursor *cursor, uint32_t level)
{
    for (uint32_t c = 0; c < cursor->replay.column_count; c++)
        cursor->columns[c].frame_bytes -= tetlodi_cursor_frame(cursor, level, TETLOD_NONE, c);
}

/* Begins with a level's records, which is counted. The log is at its end. */
static enum tetlod_status begin_records(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    TETLOD_TRY(tetlodi_cursor_room(cursor, cursor->vertices[level], cursor->tets[level], error));
    tetlodi_level_begin(&cursor->recorder, cursor->vertices[level], cursor->tets[level]);
    cursor->next_page = 0;
    return TETLOD_OK;
}

/* Begins with levels behind the first one, up to `to`, whose pages are the same parts of space, and which can be
 * held. */
static struct tetlodi_levels begin_alike(struct tetlod_cursor *cursor, uint32_t first, uint32_t to)
{
    struct tetlodi_levels levels = {first, 1, {cursor->recorder.max_labels}};
    for (uint32_t level = first + 1; level <= to && levels.count < MAX_ALIKE; level++) {
        const struct tetlodi_group *next = tetlodi_group_of(&cursor->file->index.pages, level);
        if (!next || next->tree != cursor->group->tree)
            break;
        if (count_level(cursor, level, NULL) != TETLOD_OK || begin_records(cursor, level, NULL) != TETLOD_OK) {
            uncount_level(cursor, level);
            break;
        }
        levels.max_labels[levels.count++] = cursor->recorder.max_labels;
    }
    return levels;
}

/* Decodes a level whose pages come at once, and maybe further ones with it up to `to`: decoding_level is the last. */
static enum tetlod_status decode_pages(struct tetlod_cursor *cursor, uint32_t to, struct tetlod_error *error)
{
    struct tetlodi_levels levels = begin_alike(cursor, cursor->decoding_level, to);
    enum tetlod_status status = tetlodi_decode_pages(cursor, &levels, NULL, error);
    if (status != TETLOD_OK && levels.count > 1) {
        // the first may be good; and between two a tetrahedron may go to another page of the same tree
        while (levels.count > 1)
            uncount_level(cursor, levels.first + --levels.count);
        cursor->unread = 0;
        status = tetlodi_decode_pages(cursor, &levels, NULL, error);
    }
    cursor->decoding_level = levels.first + levels.count - 1;
    cursor->starless = 1;
    return status;
}

static int decode_field(void *opaque, uint32_t number)
{
    struct tetlod_cursor *cursor = opaque;
    tetlodi_field_decode(&cursor->recorder, cursor->decoding, 1 + number);
    return 1; // its coder says whether it failed
}

/* Waits until fields have what they are being decoded from. */
static enum tetlod_status end_fields(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    tetlodi_helpers_wait(cursor->helpers);
    if (cursor->decoding)
        tetlodi_field_log_clear(cursor->decoding);
    cursor->decoding = NULL;
    for (uint32_t c = 1; c < cursor->replay.column_count; c++)
        if (cursor->recorder.coders[c].bad)
            return tetlodi_fail_field(cursor->recorder.coders[c].bad, error);
    return TETLOD_OK;
}

/* Decodes fields up to the last record: begins with it, where there are helpers. */
static enum tetlod_status begin_fields(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    struct tetlodi_recorder *recorder = &cursor->recorder;
    TETLOD_TRY(end_fields(cursor, error));
    if (!recorder->log || !recorder->log->count)
        return TETLOD_OK;
    if (!tetlodi_fields_room(recorder))
        return tetlodi_no_room(&cursor->memory, error);
    cursor->decoding = recorder->log;
    recorder->log = &recorder->logs[recorder->log == recorder->logs];
    tetlodi_helpers_start(cursor->helpers, decode_field, cursor, cursor->replay.column_count - 1);
    return TETLOD_OK;
}

/* A page is whole, if there was one. */
static enum tetlod_status end_page(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (!cursor->recorder.paged)
        return TETLOD_OK;
    TETLOD_TRY(begin_fields(cursor, error));
    TETLOD_TRY(end_fields(cursor, error));
    TETLOD_TRY(check_ends(cursor, error));
    if (cursor->replay.tets != cursor->recorder.most_tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u has fewer tetrahedra than its row says",
                            cursor->next_page - 1);
    return TETLOD_OK;
}

/* Begins with the next page that adds something. */
static enum tetlod_status begin_page(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    const struct tetlodi_group *group = cursor->group;
    const struct tetlodi_page *pages = cursor->file->index.pages.pages + group->first_page;
    TETLOD_TRY(end_page(cursor, error));
    while (!pages[cursor->next_page].vertices)
        cursor->next_page++; // all of them together are the level's
    uint32_t page = cursor->next_page++;
    TETLOD_TRY(load_frames(cursor, level, page, error));
    tetlodi_page_begin(&cursor->recorder, &cursor->lists, page, pages[page].vertices, pages[page].tets);
    return TETLOD_OK;
}

/* Goes on with a level's records, as far as *most allows. The log is at its end. */
static enum tetlod_status decode_geometry(struct tetlod_cursor *cursor, uint32_t level, uint32_t *most,
                                          struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    for (; replay->vertices < cursor->vertices[level] && *most; --*most) {
        if (cursor->group &&
            (!cursor->recorder.paged || replay->vertices == cursor->recorder.most_vertices))
            TETLOD_TRY(begin_page(cursor, level, error));
        struct tetlodi_field_log *log = cursor->recorder.log;
        if (log && log->count == FIELD_RECORDS)
            TETLOD_TRY(begin_fields(cursor, error));
        struct tetlod_error later = {0};
        enum tetlod_status status = tetlodi_record_decode(&cursor->recorder, &later);
        if (status == TETLOD_OK)
            continue;
        TETLOD_TRY(begin_fields(cursor, error));
        TETLOD_TRY(end_fields(cursor, error)); // of records before: that failure is the first
        *error = later;
        return status;
    }
    return begin_fields(cursor, error);
}

/* Decodes the level, and maybe further ones with it up to `to`: decoding_level is the last. */
static enum tetlod_status decode_records(struct tetlod_cursor *cursor, uint32_t to, uint32_t *most,
                                         struct tetlod_error *error)
{
    const uint32_t level = cursor->decoding_level;
    if (decodes_pages_at_once(cursor, *most))
        return decode_pages(cursor, to, error);
    if (cursor->group && !cursor->recorder.paged) // before its first page, which it may not have
        TETLOD_TRY(list_pages(cursor, error));
    TETLOD_TRY(decode_geometry(cursor, level, most, error));
    TETLOD_TRY(end_fields(cursor, error));
    if (cursor->replay.vertices < cursor->vertices[level])
        return TETLOD_MORE;
    if (cursor->group)
        TETLOD_TRY(end_page(cursor, error));
    if (cursor->replay.tets != cursor->tets[level])
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has %u tetrahedra, its index says %u", cursor->replay.tets,
                            cursor->tets[level]);
    return cursor->group ? TETLOD_OK : check_ends(cursor, error);
}

/* Does the tail give this column exact values? */
static int is_exact_later(const struct tetlod_cursor *cursor, uint32_t column)
{
    return column && cursor->file->index.exact_later[cursor->parts[column] - 1];
}

static int decode_exact(void *opaque, uint32_t c)
{
    struct tetlod_cursor *cursor = opaque;
    struct tetlod_error *error = &cursor->errors[c];
    if (is_exact_later(cursor, c))
        error->status = tetlodi_tail_code(&cursor->recorder.coders[c], &cursor->columns[c], cursor->replay.vertices,
                                          cursor->columns[c].other_values, error);
    return error->status == TETLOD_OK;
}

/* The tail: exact values beside those on the grid. */
static enum tetlod_status decode_tail(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    for (uint32_t c = 1; c < cursor->replay.column_count; c++) {
        struct tetlodi_column *column = &cursor->columns[c];
        size_t count = (size_t)cursor->replay.vertices * column->components;
        if (is_exact_later(cursor, c) &&
            !TETLODI_ROOM(&cursor->memory, column->other_values, column->other_capacity, count))
            return tetlodi_no_room(&cursor->memory, error);
    }
    TETLOD_TRY(for_columns(cursor, decode_exact, error));
    return check_ends(cursor, error);
}

/* Exchanges the values on the grid and the exact ones. All records are applied. */
static void exchange_exact(struct tetlod_cursor *cursor)
{
    for (uint32_t c = 1; c < cursor->replay.column_count; c++) {
        struct tetlodi_column *column = &cursor->columns[c];
        double *values = column->values;
        size_t capacity = column->values_capacity;
        if (!is_exact_later(cursor, c))
            continue;
        column->values = column->other_values;
        column->values_capacity = column->other_capacity;
        column->other_values = values;
        column->other_capacity = capacity;
    }
    cursor->exact = !cursor->exact;
}

void tetlodi_cursor_forget(struct tetlod_cursor *cursor)
{
    struct tetlodi_replay *replay = &cursor->replay;
    for (uint32_t s = replay->splits; s < replay->all_splits; s++) // those that split there may split again
        if (replay->log[s].vertex < replay->vertices)
            replay->stars[replay->log[s].vertex].leaf = 0;
    tetlodi_replay_forget(replay);
    for (uint32_t c = 0; c < replay->column_count; c++)
        if (cursor->columns[c].records > replay->records)
            cursor->columns[c].records = replay->records;
    end_level(cursor);
}

/* Takes back what was brought in of a level that is damaged, or could not be read. */
static enum tetlod_status abandon(struct tetlod_cursor *cursor, uint32_t level, enum tetlod_status status,
                                  const struct tetlod_error *inner, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    uint32_t records = cursor->records[cursor->decoded];
    while (replay->records > records && tetlodi_replay_back(replay))
        continue;
    tetlodi_cursor_forget(cursor);
    uncount_level(cursor, level);
    return tetlodi_cursor_fail(cursor, level, status, inner, error);
}

enum tetlod_status tetlodi_cursor_fail(struct tetlod_cursor *cursor, uint32_t level, enum tetlod_status status,
                                       const struct tetlod_error *inner, struct tetlod_error *error)
{
    if (cursor->unread) {
        if (error)
            *error = *inner;
        return status;
    }
    cursor->broken = status;
    tetlodi_fail(&cursor->damage, status, "level %u: %.220s", level, inner->message);
    cursor->damage.offset = cursor->file->index.info.levels[level].offset;
    if (error)
        *error = cursor->damage;
    return status;
}

/* Begins with the next level: a level in pages reads these one by one. */
static enum tetlod_status begin_level(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    cursor->decoding_level = level;
    cursor->unread = 0;
    cursor->group = tetlodi_group_of(&cursor->file->index.pages, level);
    TETLOD_TRY(count_level(cursor, level, error));
    if (!cursor->group)
        TETLOD_TRY(load_frames(cursor, level, TETLOD_NONE, error));
    return is_tail(cursor, level) ? TETLOD_OK : begin_records(cursor, level, error);
}

/* Decodes at most *most records of the next level after the log's last, on the way to `to`: OK when it is whole, MORE
 * before. The log is at its end. On failure the mesh is that of the last level that is whole. */
static enum tetlod_status decode_some(struct tetlod_cursor *cursor, uint32_t to, uint32_t *most,
                                      struct tetlod_error *error)
{
    uint32_t level = cursor->decoded + 1;
    struct tetlod_error inner = {0};
    enum tetlod_status status = TETLOD_OK;
    if (cursor->broken != TETLOD_OK) {
        if (error)
            *error = cursor->damage;
        return cursor->broken;
    }
    if (!cursor->decoding_level)
        status = begin_level(cursor, level, &inner);
    if (status == TETLOD_OK)
        status = is_tail(cursor, level) ? decode_tail(cursor, &inner) : decode_records(cursor, to, most, &inner);
    if (status == TETLOD_MORE)
        return TETLOD_MORE;
    if (status != TETLOD_OK)
        return abandon(cursor, level, status, &inner, error);
    level = cursor->decoding_level;
    end_level(cursor);
    cursor->records[level] = cursor->replay.records;
    cursor->decoded = level;
    return TETLOD_OK;
}

/* To the end of the log, behind which decoding goes on. */
static enum tetlod_status go_to_end(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (cursor->replay.records < cursor->replay.all_records)
        TETLOD_TRY(tetlodi_cursor_stars(cursor, error));
    while (cursor->replay.records < cursor->replay.all_records)
        if (!tetlodi_replay_forward(&cursor->replay))
            return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
}

/* Decodes the next level, and maybe further ones up to `to`. */
static enum tetlod_status decode_level(struct tetlod_cursor *cursor, uint32_t to, struct tetlod_error *error)
{
    uint32_t most = UINT32_MAX;
    TETLOD_TRY(go_to_end(cursor, error));
    return decode_some(cursor, to, &most, error);
}

/* ---- opening */

static enum tetlod_status add_column(struct tetlod_cursor *cursor, uint32_t part, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &cursor->file->index;
    uint32_t n = cursor->replay.column_count;
    for (uint32_t c = 0; c < n; c++)
        if (cursor->parts[c] == part)
            return TETLOD_OK;
    if (part > index->info.field_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no field number %u", part - 1);
    cursor->parts[n] = part;
    cursor->columns[n].scale = index->scales[part];
    cursor->columns[n].components = part ? index->info.fields[part - 1].components : 3;
    cursor->replay.column_count++;
    return TETLOD_OK;
}

static enum tetlod_status select_columns(struct tetlod_cursor *cursor, const uint32_t *fields, uint32_t field_count,
                                         struct tetlod_error *error)
{
    uint32_t all = cursor->file->index.info.field_count;
    TETLOD_TRY(add_column(cursor, 0, error));
    for (uint32_t i = 0; i < (fields ? field_count : all); i++) {
        uint32_t field = fields ? fields[i] : i;
        TETLOD_TRY(add_column(cursor, field >= all ? all + 1 : field + 1, error));
    }
    return TETLOD_OK;
}

static enum tetlod_status open_base(struct tetlod_cursor *cursor, const uint32_t *fields, uint32_t field_count,
                                    struct tetlod_error *error)
{
    TETLOD_TRY(select_columns(cursor, fields, field_count, error));
    TETLOD_TRY(tetlodi_recorder_init(&cursor->recorder, &cursor->replay, error));
    if (!tetlodi_count(&cursor->memory, cursor->file->index_bytes + tetlodi_recorder_bytes(&cursor->recorder)))
        return tetlodi_no_room(&cursor->memory, error);
    TETLOD_TRY(load_frames(cursor, 0, TETLOD_NONE, error));
    enum tetlod_status status = decode_base(cursor, error);
    if (status == TETLOD_OK)
        status = check_ends(cursor, error);
    end_level(cursor);
    return status;
}

enum tetlod_status tetlod_cursor_new(struct tetlod_cursor **out, struct tetlod_file *file, const uint32_t *fields,
                                     uint32_t field_count, struct tetlod_error *error)
{
    const struct tetlod_info *info = &file->index.info;
    struct tetlod_cursor *cursor = calloc(1, sizeof *cursor);
    *out = NULL;
    if (!cursor)
        return tetlodi_fail_nomem(error, "a cursor", sizeof *cursor);
    cursor->file = file;
    cursor->memory = (struct tetlodi_memory){.most = tetlodi_memory_limit(file), .allocate = file->options.allocate,
                                             .opaque = file->options.opaque};
    cursor->columns = calloc(1 + (size_t)info->field_count, sizeof *cursor->columns);
    cursor->parts = calloc(1 + (size_t)info->field_count, sizeof *cursor->parts);
    cursor->fields = calloc(1 + (size_t)info->field_count, sizeof *cursor->fields);
    cursor->records = calloc(info->level_count, sizeof *cursor->records);
    cursor->vertices = calloc(info->level_count, sizeof *cursor->vertices);
    cursor->tets = calloc(info->level_count, sizeof *cursor->tets);
    cursor->errors = calloc(1 + (size_t)info->field_count, sizeof *cursor->errors);
    tetlodi_replay_init(&cursor->replay, &cursor->memory, cursor->columns, 0);
    enum tetlod_status status;
    if (!cursor->columns || !cursor->parts || !cursor->fields || !cursor->records || !cursor->vertices ||
        !cursor->tets || !cursor->errors)
        status = tetlodi_fail_nomem(error, "a cursor", info->level_count * sizeof *cursor->records);
    else
        status = open_base(cursor, fields, field_count, error);
    if (status == TETLOD_OK)
        *out = cursor;
    else
        tetlod_cursor_free(cursor);
    return status;
}

void tetlodi_choice_free(struct tetlod_cursor *cursor)
{
    struct tetlodi_choice *choice = cursor->choice;
    if (!choice)
        return;
    TETLODI_FREE(&cursor->memory, choice->page_of, choice->page_of_capacity);
    free(choice->has);
    free(choice->wanted);
    free(choice->logs);
    free(choice);
    cursor->choice = NULL;
}

void tetlod_cursor_free(struct tetlod_cursor *cursor)
{
    if (!cursor)
        return;
    end_level(cursor);
    tetlodi_choice_free(cursor);
    tetlodi_recorder_fini(&cursor->recorder);
    tetlodi_replay_fini(&cursor->replay);
    free(cursor->columns);
    free(cursor->parts);
    free(cursor->fields);
    free(cursor->records);
    free(cursor->vertices);
    free(cursor->tets);
    free(cursor->errors);
    free(cursor);
}

/* ---- moving */

/* The current level, from the number of records applied. */
static void settle(struct tetlod_cursor *cursor)
{
    uint32_t records = cursor->replay.records, finest = cursor->decoded - (is_tail(cursor, cursor->decoded) &&
                                                                           !cursor->exact);
    cursor->level = cursor->level < finest ? cursor->level : finest;
    while (cursor->level < finest && records >= cursor->records[cursor->level + 1])
        cursor->level++;
    while (cursor->level && records < cursor->records[cursor->level])
        cursor->level--;
}

/* Are pages to come before the mesh can be that of a level? */
static bool is_short(const struct tetlod_cursor *cursor, uint32_t level)
{
    return cursor->choice && cursor->choice->next <= level;
}

/* Is the mesh exactly that of a level? */
static int at_level(const struct tetlod_cursor *cursor, uint32_t level)
{
    return level <= cursor->decoded && !is_short(cursor, level) && cursor->replay.records == cursor->records[level] &&
           cursor->exact == is_tail(cursor, level);
}

static bool is_root_decoded(const struct tetlod_cursor *cursor)
{
    return cursor->decoded + 1 >= cursor->file->index.pages.first_level;
}

/* One record up, on the way to a level, from the log, or decoded; of some pages a page, and more if they have not more
 * than *records vertices. */
static enum tetlod_status one_up(struct tetlod_cursor *cursor, uint32_t level, uint32_t *records,
                                 struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    uint32_t most = 1;
    if (is_short(cursor, level) && is_root_decoded(cursor) && replay->records == replay->all_records)
        return cursor->choice->bring(cursor, records, error);
    --*records;
    TETLOD_TRY(tetlodi_cursor_stars(cursor, error));
    if (replay->records < replay->all_records)
        return tetlodi_replay_forward(replay) ? TETLOD_OK : tetlodi_no_room(&cursor->memory, error);
    if (cursor->decoded < level) {
        enum tetlod_status status = decode_some(cursor, level, &most, error);
        if (status != TETLOD_OK || !is_tail(cursor, cursor->decoded))
            return status == TETLOD_MORE ? TETLOD_OK : status;
    }
    if (!cursor->exact && is_tail(cursor, level))
        exchange_exact(cursor);
    return TETLOD_OK;
}

static enum tetlod_status one_down(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    TETLOD_TRY(tetlodi_cursor_stars(cursor, error));
    if (cursor->exact)
        exchange_exact(cursor);
    else if (!tetlodi_replay_back(&cursor->replay))
        return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_refine(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    uint32_t finest = finest_level(cursor), most = 1;
    if (at_level(cursor, finest))
        return TETLOD_END;
    enum tetlod_status status = one_up(cursor, finest, &most, error);
    settle(cursor);
    return status;
}

enum tetlod_status tetlod_cursor_coarsen(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (at_level(cursor, 0))
        return TETLOD_END;
    enum tetlod_status status = one_down(cursor, error);
    settle(cursor);
    return status;
}

static enum tetlod_status check_level(const struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    uint32_t finest = finest_level(cursor);
    if (level > finest && finest < cursor->file->index.info.level_count - 1)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "its pages are of levels up to %u, not %u", finest, level);
    if (level > finest)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no level %u; the finest is %u", level, finest);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_step(struct tetlod_cursor *cursor, uint32_t level, uint32_t records,
                                      struct tetlod_error *error)
{
    enum tetlod_status status = check_level(cursor, level, error);
    while (records && status == TETLOD_OK && !at_level(cursor, level)) {
        bool up = level > cursor->level || is_short(cursor, level);
        records -= !up;
        status = up ? one_up(cursor, level, &records, error) : one_down(cursor, error);
        settle(cursor);
    }
    return status == TETLOD_OK && !at_level(cursor, level) ? TETLOD_MORE : status;
}

enum tetlod_status tetlodi_cursor_go_to(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    if (cursor->exact && !is_tail(cursor, level))
        exchange_exact(cursor);
    if (replay->records != cursor->records[level])
        TETLOD_TRY(tetlodi_cursor_stars(cursor, error));
    while (replay->records < cursor->records[level])
        if (!tetlodi_replay_forward(replay))
            return tetlodi_no_room(&cursor->memory, error);
    while (replay->records > cursor->records[level])
        if (!tetlodi_replay_back(replay))
            return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
}

/* Of some pages: those that are to come, up to a level. */
static enum tetlod_status bring_pages(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    while (!is_root_decoded(cursor))
        TETLOD_TRY(decode_level(cursor, cursor->file->index.pages.first_level - 1, error));
    while (is_short(cursor, level)) {
        uint32_t most = UINT32_MAX;
        TETLOD_TRY(cursor->choice->bring(cursor, &most, error));
    }
    return TETLOD_OK;
}

static enum tetlod_status move_to(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    if (is_short(cursor, level))
        TETLOD_TRY(bring_pages(cursor, level, error));
    TETLOD_TRY(tetlodi_cursor_go_to(cursor, level < cursor->decoded ? level : cursor->decoded, error));
    while (cursor->decoded < level)
        TETLOD_TRY(decode_level(cursor, level, error));
    if (!cursor->exact && is_tail(cursor, level))
        exchange_exact(cursor);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_seek(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    TETLOD_TRY(check_level(cursor, level, error));
    if ((level > cursor->decoded || is_short(cursor, level)) && cursor->file->options.threads > 1 &&
        (cursor->replay.column_count > 1 || cursor->file->index.pages.group_count))
        cursor->helpers = tetlodi_helpers_new(cursor->file->options.threads - 1);
    enum tetlod_status status = move_to(cursor, level, error);
    tetlodi_helpers_free(cursor->helpers);
    cursor->helpers = NULL;
    settle(cursor);
    return status;
}
