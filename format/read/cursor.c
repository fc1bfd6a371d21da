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
    tetlodi_page_lists_fini(&cursor->lists, &cursor->memory);
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
    error->status =
        tetlodi_read_frame(cursor->file, cursor->loading, cursor->parts[column], &cursor->frames[column], &size, error);
    if (error->status == TETLOD_OK)
        tetlodi_decode_start(&cursor->recorder.coders[column], cursor->file->index.slowest, cursor->frames[column],
                             size);
    return error->status == TETLOD_OK;
}

/* Reads a level's frames of the selected parts and starts the coders on them. They are kept until the level is
 * decoded. */
static enum tetlod_status load_frames(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &cursor->file->index;
    const struct tetlodi_frame *frames = index->frames + level * (1 + (size_t)index->info.field_count);
    uint32_t count = cursor->replay.column_count;
    enum tetlod_status status = TETLOD_OK;
    cursor->frames = calloc(count, sizeof *cursor->frames);
    if (!cursor->frames)
        return tetlodi_fail_nomem(error, "a level", count * sizeof *cursor->frames);
    for (uint32_t c = 0; c < count && status == TETLOD_OK; c++) {
        uint64_t stored = frames[cursor->parts[c]].size;
        if (tetlodi_count(&cursor->memory, stored))
            cursor->frame_bytes += stored;
        else
            status = tetlodi_no_room(&cursor->memory, error);
    }
    cursor->loading = level;
    if (status == TETLOD_OK)
        status = for_columns(cursor, load_frame, error);
    if (status != TETLOD_OK)
        free_frames(cursor);
    return status;
}

/* Frames hold what an encoder writes, and end where that ends, but for zero bytes. */
static enum tetlod_status check_ends(const struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    for (uint32_t c = 0; c < cursor->replay.column_count; c++) {
        const struct tetlodi_coder *coder = &cursor->recorder.coders[c];
        if (coder->bad)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "it holds what no writer writes");
        for (const uint8_t *at = coder->at; at < coder->end; at++)
            if (*at)
                return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has bytes that belong to nothing");
    }
    return TETLOD_OK;
}

/* Room for a level's mesh and columns. */
static enum tetlod_status make_room(struct tetlod_cursor *cursor, const struct tetlod_level *level,
                                    struct tetlod_error *error)
{
    int done = tetlodi_replay_room(&cursor->replay, level->vertices, level->tets);
    for (uint32_t c = 0; c < cursor->replay.column_count && done; c++)
        done = tetlodi_column_room(&cursor->columns[c], &cursor->memory, level->vertices, 0);
    return done ? TETLOD_OK : tetlodi_no_room(&cursor->memory, error);
}

/* Once for each level. */
static void add_frame_bytes(struct tetlod_cursor *cursor, uint32_t level)
{
    const struct tetlodi_index *index = &cursor->file->index;
    const struct tetlodi_frame *frames = index->frames + level * (1 + (size_t)index->info.field_count);
    for (uint32_t c = 0; c < cursor->replay.column_count; c++)
        cursor->columns[c].frame_bytes += frames[cursor->parts[c]].size;
}

static enum tetlod_status decode_base(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct tetlod_level *base = &cursor->file->index.info.levels[0];
    struct tetlodi_replay *replay = &cursor->replay;
    struct tetlodi_recorder *recorder = &cursor->recorder;
    TETLOD_TRY(make_room(cursor, base, error));
    add_frame_bytes(cursor, 0);
    TETLOD_TRY(tetlodi_base_connectivity(recorder, base->vertices, base->tets, NULL, error));
    TETLOD_TRY(tetlodi_base_column(replay, cursor->columns, recorder->coders, recorder->models->corner, NULL, error));
    for (uint32_t c = 1; c < replay->column_count; c++) {
        struct tetlodi_field_models *models = &recorder->field_models[c - 1];
        tetlodi_copies_code(&recorder->coders[c], models, cursor->columns[c].components);
        TETLOD_TRY(tetlodi_base_column(replay, &cursor->columns[c], &recorder->coders[c], &models->corner,
                                       models->copied, error));
    }
    return tetlodi_replay_base(replay) ? TETLOD_OK : tetlodi_no_room(&cursor->memory, error);
}

/* Begins with a level's records. The log is at its end. */
static enum tetlod_status begin_records(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    const struct tetlod_level *to = &cursor->file->index.info.levels[level];
    TETLOD_TRY(make_room(cursor, to, error));
    add_frame_bytes(cursor, level);
    tetlodi_level_begin(&cursor->recorder, to->vertices, to->tets);
    cursor->group = tetlodi_group_of(&cursor->file->index.pages, level);
    cursor->next_page = 0;
    if (cursor->group && !tetlodi_page_lists_make(&cursor->lists, &cursor->replay, cursor->group))
        return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
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
            return tetlodi_fail(error, TETLOD_ERR_STREAM, cursor->recorder.coders[c].bad == BAD_VALUE
                                                              ? "a record holds a value that is not finite"
                                                              : "a record holds what no writer writes");
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

/* Begins with the next page that adds something, behind the frames of the one before. */
static enum tetlod_status begin_page(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &cursor->file->index;
    const struct tetlodi_group *group = cursor->group;
    const struct tetlodi_page *pages = index->pages.pages + group->first_page;
    struct tetlodi_recorder *recorder = &cursor->recorder;
    if (recorder->paged) { // there was a page
        TETLOD_TRY(begin_fields(cursor, error));
        TETLOD_TRY(end_fields(cursor, error));
        TETLOD_TRY(check_ends(cursor, error));
        if (cursor->replay.tets != recorder->most_tets)
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "page %u has fewer tetrahedra than its row says",
                                cursor->next_page - 1);
    }
    while (!pages[cursor->next_page].vertices) // all of them together are the level's
        cursor->next_page++;
    uint32_t page = cursor->next_page++;
    for (uint32_t c = 0; c < cursor->replay.column_count; c++) {
        const uint8_t *at = recorder->paged ? recorder->coders[c].end : cursor->frames[c];
        uint32_t size = tetlodi_page_frame(&index->pages, index->info.field_count, group, page, cursor->parts[c])->size;
        tetlodi_decode_start(&recorder->coders[c], index->slowest, at, size);
    }
    tetlodi_page_begin(recorder, &cursor->lists, page, pages[page].vertices, pages[page].tets);
    return TETLOD_OK;
}

/* Goes on with a level's records, as far as *most allows. The log is at its end. */
static enum tetlod_status decode_geometry(struct tetlod_cursor *cursor, const struct tetlod_level *to, uint32_t *most,
                                          struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    for (; replay->vertices < to->vertices && *most; --*most) {
        if (cursor->group &&
            (!cursor->recorder.paged || replay->vertices == cursor->recorder.most_vertices))
            TETLOD_TRY(begin_page(cursor, error));
        struct tetlodi_field_log *log = cursor->recorder.log;
        if (log && log->count == FIELD_RECORDS)
            TETLOD_TRY(begin_fields(cursor, error));
        if (!tetlodi_level_next(&cursor->recorder))
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has fewer records than its index says");
        struct tetlodi_record record = {.vertex = cursor->recorder.walk, .children = 2};
        TETLOD_TRY(tetlodi_record_code(&cursor->recorder, &record, error));
    }
    return begin_fields(cursor, error);
}

static enum tetlod_status decode_records(struct tetlod_cursor *cursor, uint32_t level, uint32_t *most,
                                         struct tetlod_error *error)
{
    const struct tetlod_level *to = &cursor->file->index.info.levels[level];
    struct tetlod_error later = {0};
    enum tetlod_status status = decode_geometry(cursor, to, most, &later);
    TETLOD_TRY(end_fields(cursor, error)); // of records before: that failure is the first
    if (status != TETLOD_OK) {
        *error = later;
        return status;
    }
    if (cursor->replay.vertices < to->vertices)
        return TETLOD_MORE;
    if (cursor->replay.tets != to->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has %u tetrahedra, its index says %u", cursor->replay.tets,
                            to->tets);
    return TETLOD_OK;
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
    return for_columns(cursor, decode_exact, error);
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

/* Takes back what of a damaged level was brought in, and remembers that it is damaged. */
static enum tetlod_status abandon(struct tetlod_cursor *cursor, uint32_t level, enum tetlod_status status,
                                  const struct tetlod_error *inner, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    uint32_t records = cursor->records[cursor->decoded];
    while (replay->records > records && tetlodi_replay_back(replay))
        continue;
    tetlodi_replay_forget(replay);
    for (uint32_t c = 0; c < replay->column_count; c++)
        if (cursor->columns[c].records > replay->records)
            cursor->columns[c].records = replay->records;
    free_frames(cursor);
    cursor->broken = status;
    tetlodi_fail(&cursor->damage, status, "level %u: %.220s", level, inner->message);
    cursor->damage.offset = cursor->file->index.info.levels[level].offset;
    if (error)
        *error = cursor->damage;
    return status;
}

/* Decodes at most *most records of the next level after the log's last: OK when it is whole, MORE before. The log is at
 * its end. On failure the mesh is that of the last level that is whole. */
static enum tetlod_status decode_some(struct tetlod_cursor *cursor, uint32_t *most, struct tetlod_error *error)
{
    uint32_t level = cursor->decoded + 1;
    struct tetlod_error inner = {0};
    enum tetlod_status status = TETLOD_OK;
    int tail = is_tail(cursor, level);
    if (cursor->broken != TETLOD_OK) {
        if (error)
            *error = cursor->damage;
        return cursor->broken;
    }
    if (!cursor->frames) {
        TETLOD_TRY(load_frames(cursor, level, error));
        status = tail ? TETLOD_OK : begin_records(cursor, level, &inner);
    }
    if (status == TETLOD_OK)
        status = tail ? decode_tail(cursor, &inner) : decode_records(cursor, level, most, &inner);
    if (status == TETLOD_MORE)
        return TETLOD_MORE;
    if (status == TETLOD_OK)
        status = check_ends(cursor, &inner);
    if (status != TETLOD_OK)
        return abandon(cursor, level, status, &inner, error);
    free_frames(cursor);
    cursor->records[level] = cursor->replay.records;
    cursor->decoded = level;
    return TETLOD_OK;
}

/* To the end of the log, behind which decoding goes on. */
static enum tetlod_status go_to_end(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    while (cursor->replay.records < cursor->replay.all_records)
        if (!tetlodi_replay_forward(&cursor->replay))
            return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
}

static enum tetlod_status decode_level(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    uint32_t most = UINT32_MAX;
    TETLOD_TRY(go_to_end(cursor, error));
    return decode_some(cursor, &most, error);
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
    TETLOD_TRY(load_frames(cursor, 0, error));
    enum tetlod_status status = decode_base(cursor, error);
    if (status == TETLOD_OK)
        status = check_ends(cursor, error);
    free_frames(cursor);
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
    cursor->errors = calloc(1 + (size_t)info->field_count, sizeof *cursor->errors);
    tetlodi_replay_init(&cursor->replay, &cursor->memory, cursor->columns, 0);
    enum tetlod_status status;
    if (!cursor->columns || !cursor->parts || !cursor->fields || !cursor->records || !cursor->errors)
        status = tetlodi_fail_nomem(error, "a cursor", info->level_count * sizeof *cursor->records);
    else
        status = open_base(cursor, fields, field_count, error);
    if (status == TETLOD_OK)
        *out = cursor;
    else
        tetlod_cursor_free(cursor);
    return status;
}

void tetlod_cursor_free(struct tetlod_cursor *cursor)
{
    if (!cursor)
        return;
    free_frames(cursor);
    tetlodi_recorder_fini(&cursor->recorder);
    tetlodi_replay_fini(&cursor->replay);
    free(cursor->columns);
    free(cursor->parts);
    free(cursor->fields);
    free(cursor->records);
    free(cursor->errors);
    free(cursor);
}

/* ---- moving */

/* The level at hand, from the number of records applied. */
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

/* Is the mesh exactly that of a level? */
static int at_level(const struct tetlod_cursor *cursor, uint32_t level)
{
    return level <= cursor->decoded && cursor->replay.records == cursor->records[level] && cursor->exact == is_tail(cursor, level);
}

/* One record up, on the way to a level: from the log, or decoded. */
static enum tetlod_status one_up(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    uint32_t most = 1;
    if (replay->records < replay->all_records)
        return tetlodi_replay_forward(replay) ? TETLOD_OK : tetlodi_no_room(&cursor->memory, error);
    if (cursor->decoded < level) {
        enum tetlod_status status = decode_some(cursor, &most, error);
        if (status != TETLOD_OK || !is_tail(cursor, cursor->decoded))
            return status == TETLOD_MORE ? TETLOD_OK : status;
    }
    if (!cursor->exact && is_tail(cursor, level))
        exchange_exact(cursor);
    return TETLOD_OK;
}

static enum tetlod_status one_down(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (cursor->exact)
        exchange_exact(cursor);
    else if (!tetlodi_replay_back(&cursor->replay))
        return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_refine(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    uint32_t finest = cursor->file->index.info.level_count - 1;
    if (at_level(cursor, finest))
        return TETLOD_END;
    enum tetlod_status status = one_up(cursor, finest, error);
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
    uint32_t finest = cursor->file->index.info.level_count - 1;
    if (level > finest)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no level %u; the finest is %u", level, finest);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_step(struct tetlod_cursor *cursor, uint32_t level, uint32_t records,
                                      struct tetlod_error *error)
{
    enum tetlod_status status = check_level(cursor, level, error);
    for (; records && status == TETLOD_OK && !at_level(cursor, level); records--) {
        status = level > cursor->level ? one_up(cursor, level, error) : one_down(cursor, error);
        settle(cursor);
    }
    return status == TETLOD_OK && !at_level(cursor, level) ? TETLOD_MORE : status;
}

static enum tetlod_status move_to(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    uint32_t known = level < cursor->decoded ? level : cursor->decoded;
    if (cursor->exact && !is_tail(cursor, level))
        exchange_exact(cursor);
    while (replay->records < cursor->records[known])
        if (!tetlodi_replay_forward(replay))
            return tetlodi_no_room(&cursor->memory, error);
    while (replay->records > cursor->records[known])
        if (!tetlodi_replay_back(replay))
            return tetlodi_no_room(&cursor->memory, error);
    while (cursor->decoded < level)
        TETLOD_TRY(decode_level(cursor, error));
    if (!cursor->exact && is_tail(cursor, level))
        exchange_exact(cursor);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_seek(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    TETLOD_TRY(check_level(cursor, level, error));
    if (level > cursor->decoded && cursor->replay.column_count > 1 && cursor->file->options.threads > 1)
        cursor->helpers = tetlodi_helpers_new(cursor->file->options.threads - 1);
    enum tetlod_status status = move_to(cursor, level, error);
    tetlodi_helpers_free(cursor->helpers);
    cursor->helpers = NULL;
    settle(cursor);
    return status;
}
