/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A cursor decodes each level once, in order, because what the coder has learned carries on from level to level. What is
 * decoded stays in the replay's log, so that going down and up again costs no decoding.
 */
#include <stdlib.h>
#include <string.h>

#include "format/base.h"
#include "format/fail.h"
#include "format/reader.h"
#include "format/record_fields.h"
#include "format/tail.h"

struct tetlod_cursor {
    struct tetlod_file *file; /* borrowed */
    struct tetlodi_memory memory;
    struct tetlodi_column *columns; /* positions, then the selected fields */
    uint32_t *parts;                /* [column] the part of each level that holds it */
    const double **fields;          /* [field_count] for tetlod_cursor_mesh */
    struct tetlodi_replay replay;
    struct tetlodi_recorder recorder;
    uint32_t *records; /* [level] in the log at the level's end, as far as decoded */
    uint32_t level, decoded; /* the level at hand, or the one below; the finest in the log */
    int exact;               /* fields have the tail's values: level is the last */
    enum tetlod_status broken; /* why no level above `decoded` can be had */
    struct tetlod_error damage;
};

/* Reads a level's frames of the selected parts and starts the coders on them. The bytes are in frames[]. */
static enum tetlod_status load_frames(struct tetlod_cursor *cursor, uint32_t level, uint8_t **frames,
                                      struct tetlod_error *error)
{
    for (uint32_t c = 0; c < cursor->replay.column_count; c++) {
        size_t size;
        TETLOD_TRY(tetlodi_read_frame(cursor->file, level, cursor->parts[c], &frames[c], &size, error));
        tetlodi_decode_start(&cursor->recorder.coders[c], cursor->file->index.slowest, frames[c], size);
    }
    return TETLOD_OK;
}

static enum tetlod_status decode_base(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct tetlod_level *base = &cursor->file->index.info.levels[0];
    struct tetlodi_replay *replay = &cursor->replay;
    struct tetlodi_recorder *recorder = &cursor->recorder;
    if (!tetlodi_replay_room(replay, base->vertices, base->tets))
        return tetlodi_no_room(&cursor->memory, error);
    TETLOD_TRY(tetlodi_base_connectivity(recorder, base->vertices, base->tets, NULL, error));
    TETLOD_TRY(tetlodi_base_column(replay, cursor->columns, recorder->coders, recorder->models->corner, NULL, error));
    for (uint32_t c = 1; c < replay->column_count; c++) {
        struct tetlodi_field_models *models = &recorder->field_models[c - 1];
        tetlodi_copies_code(&recorder->coders[c], models, cursor->columns[c].components);
        TETLOD_TRY(tetlodi_base_column(replay, &cursor->columns[c], &recorder->coders[c], &models->corner, models->copied, error));
    }
    return tetlodi_replay_base(replay) ? TETLOD_OK : tetlodi_no_room(&cursor->memory, error);
}

static enum tetlod_status decode_records(struct tetlod_cursor *cursor, uint32_t level, struct tetlod_error *error)
{
    const struct tetlod_level *to = &cursor->file->index.info.levels[level];
    struct tetlodi_replay *replay = &cursor->replay;
    if (!tetlodi_replay_room(replay, to->vertices, to->tets))
        return tetlodi_no_room(&cursor->memory, error);
    tetlodi_level_begin(&cursor->recorder, to->vertices, to->tets);
    while (replay->vertices < to->vertices) {
        if (!tetlodi_level_next(&cursor->recorder))
            return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has fewer records than its index says");
        struct tetlodi_record record = {.vertex = cursor->recorder.walk, .children = 2};
        TETLOD_TRY(tetlodi_record_code(&cursor->recorder, &record, error));
    }
    if (replay->tets != to->tets)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "it has %u tetrahedra, its index says %u", replay->tets, to->tets);
    return TETLOD_OK;
}

/* The tail: exact values beside those on the grid. */
static enum tetlod_status decode_tail(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    const struct tetlodi_index *index = &cursor->file->index;
    for (uint32_t c = 1; c < cursor->replay.column_count; c++) {
        struct tetlodi_column *column = &cursor->columns[c];
        size_t count = (size_t)cursor->replay.vertices * column->components;
        if (!index->exact_later[cursor->parts[c] - 1])
            continue;
        if (!TETLODI_ROOM(&cursor->memory, column->other_values, column->other_capacity, count))
            return tetlodi_no_room(&cursor->memory, error);
        TETLOD_TRY(tetlodi_tail_code(&cursor->recorder.coders[c], column, cursor->replay.vertices, column->other_values, error));
    }
    return TETLOD_OK;
}

/* Exchanges the values on the grid and the exact ones. All records are applied. */
static void exchange_exact(struct tetlod_cursor *cursor)
{
    for (uint32_t c = 1; c < cursor->replay.column_count; c++) {
        struct tetlodi_column *column = &cursor->columns[c];
        double *values = column->values;
        size_t capacity = column->values_capacity;
        if (!cursor->file->index.exact_later[cursor->parts[c] - 1])
            continue;
        column->values = column->other_values;
        column->values_capacity = column->other_capacity;
        column->other_values = values;
        column->other_capacity = capacity;
    }
    cursor->exact = !cursor->exact;
}

static int is_tail(const struct tetlod_cursor *cursor, uint32_t level)
{
    return cursor->file->index.tail && level + 1 == cursor->file->index.info.level_count;
}

/* Takes back what of a damaged level was brought in, and remembers that it is damaged. */
static void abandon(struct tetlod_cursor *cursor, enum tetlod_status status, const struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    uint32_t records = cursor->records[cursor->decoded];
    while (replay->records > records && tetlodi_replay_back(replay))
        continue;
    tetlodi_replay_forget(replay);
    cursor->broken = status;
    cursor->damage = *error;
}

/* Decodes the next level after the log's last. On failure the mesh is as it was. */
static enum tetlod_status decode_level(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    uint32_t level = cursor->decoded + 1, columns = cursor->replay.column_count;
    struct tetlod_error inner = {0};
    if (cursor->broken != TETLOD_OK) {
        if (error)
            *error = cursor->damage;
        return cursor->broken;
    }
    uint8_t **frames = calloc(columns, sizeof *frames);
    if (!frames)
        return tetlodi_fail_nomem(error, "a level", columns * sizeof *frames);
    enum tetlod_status status = load_frames(cursor, level, frames, error);
    if (status == TETLOD_OK) {
        status = is_tail(cursor, level) ? decode_tail(cursor, &inner) : decode_records(cursor, level, &inner);
        if (status == TETLOD_OK) {
            cursor->records[level] = cursor->replay.records;
            cursor->decoded = level;
        } else {
            struct tetlod_error damage;
            tetlodi_fail(&damage, status, "level %u: %.220s", level, inner.message);
            damage.offset = cursor->file->index.info.levels[level].offset;
            abandon(cursor, status, &damage);
            if (error)
                *error = damage;
        }
    }
    for (uint32_t c = 0; c < columns; c++)
        free(frames[c]);
    free(frames);
    return status;
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
    uint32_t columns = cursor->replay.column_count;
    uint8_t **frames = calloc(columns, sizeof *frames);
    if (!frames)
        return tetlodi_fail_nomem(error, "the base mesh", columns * sizeof *frames);
    enum tetlod_status status = load_frames(cursor, 0, frames, error);
    if (status == TETLOD_OK)
        status = decode_base(cursor, error);
    for (uint32_t c = 0; c < columns; c++)
        free(frames[c]);
    free(frames);
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
    cursor->memory.most = file->max_bytes;
    cursor->columns = calloc(1 + (size_t)info->field_count, sizeof *cursor->columns);
    cursor->parts = calloc(1 + (size_t)info->field_count, sizeof *cursor->parts);
    cursor->fields = calloc(1 + (size_t)info->field_count, sizeof *cursor->fields);
    cursor->records = calloc(info->level_count, sizeof *cursor->records);
    tetlodi_replay_init(&cursor->replay, &cursor->memory, cursor->columns, 0);
    enum tetlod_status status;
    if (!cursor->columns || !cursor->parts || !cursor->fields || !cursor->records)
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
    tetlodi_recorder_fini(&cursor->recorder);
    tetlodi_replay_fini(&cursor->replay);
    free(cursor->columns);
    free(cursor->parts);
    free(cursor->fields);
    free(cursor->records);
    free(cursor);
}

/* ---- moving */

/* The level at hand, from the number of records applied. */
static void settle(struct tetlod_cursor *cursor)
{
    uint32_t records = cursor->replay.records, finest = cursor->decoded - (is_tail(cursor, cursor->decoded) && !cursor->exact);
    cursor->level = cursor->level < finest ? cursor->level : finest;
    while (cursor->level < finest && records >= cursor->records[cursor->level + 1])
        cursor->level++;
    while (cursor->level && records < cursor->records[cursor->level])
        cursor->level--;
}

/* Decodes the level after the last one of the log while standing at its end, and goes back to where the cursor was. */
static enum tetlod_status extend(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    uint32_t records = cursor->replay.records;
    TETLOD_TRY(decode_level(cursor, error));
    while (cursor->replay.records > records)
        if (!tetlodi_replay_back(&cursor->replay))
            return tetlodi_no_room(&cursor->memory, error);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_refine(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = &cursor->replay;
    if (replay->records == replay->all_records && !is_tail(cursor, cursor->decoded)) {
        if (cursor->decoded + 1 == cursor->file->index.info.level_count)
            return TETLOD_END;
        TETLOD_TRY(extend(cursor, error));
    }
    if (replay->records < replay->all_records) {
        if (!tetlodi_replay_forward(replay))
            return tetlodi_no_room(&cursor->memory, error);
    } else if (cursor->exact) {
        return TETLOD_END;
    } else {
        exchange_exact(cursor);
    }
    settle(cursor);
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_coarsen(struct tetlod_cursor *cursor, struct tetlod_error *error)
{
    if (cursor->exact)
        exchange_exact(cursor);
    else if (!cursor->replay.records)
        return TETLOD_END;
    else if (!tetlodi_replay_back(&cursor->replay))
        return tetlodi_no_room(&cursor->memory, error);
    settle(cursor);
    return TETLOD_OK;
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
    if (level >= cursor->file->index.info.level_count)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there is no level %u; the finest is %u", level,
                            cursor->file->index.info.level_count - 1);
    enum tetlod_status status = move_to(cursor, level, error);
    settle(cursor);
    return status;
}

void tetlod_cursor_mesh(const struct tetlod_cursor *cursor, struct tetlod_mesh *out)
{
    const struct tetlodi_replay *replay = &cursor->replay;
    for (uint32_t c = 1; c < replay->column_count; c++)
        cursor->fields[cursor->parts[c] - 1] = cursor->columns[c].values;
    *out = (struct tetlod_mesh){.vertices = replay->vertices,
                                .tets = replay->tets,
                                .level = cursor->level,
                                .positions = cursor->columns[0].values,
                                .fields = cursor->fields,
                                .corners = replay->corners,
                                .parents = replay->parents};
}

/* What a column had at the end of record number `records`, for the vertices that were there: undone on a copy. */
static void values_before(const struct tetlod_cursor *cursor, const struct tetlodi_column *column, uint32_t records,
                          uint32_t count, double *out)
{
    const struct tetlodi_replay *replay = &cursor->replay;
    size_t n = column->components;
    int exact = cursor->exact && column->other_values;
    memcpy(out, exact ? column->other_values : column->values, count * n * sizeof *out);
    for (uint32_t split = replay->splits, record = replay->records; record > records;) {
        const struct tetlodi_split *log = &replay->log[--split];
        if (!(log->tets & SPLIT_FIRST))
            continue;
        record--;
        for (unsigned c = 0; c < n && log->vertex < count; c++)
            out[log->vertex * n + c] =
                scale_value(&column->scale, column == cursor->columns ? c : 0, column->before[record * n + c]);
    }
}

enum tetlod_status tetlod_cursor_origins(const struct tetlod_cursor *cursor, uint32_t level, double *positions,
                                         double *const *fields, struct tetlod_error *error)
{
    const struct tetlodi_replay *replay = &cursor->replay;
    if (level > cursor->level)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "level %u is finer than the cursor's %u", level, cursor->level);
    uint32_t count = cursor->file->index.info.levels[level].vertices;
    for (uint32_t c = 0; c < replay->column_count; c++) {
        double *out = c ? fields ? fields[cursor->parts[c] - 1] : NULL : positions;
        size_t n = cursor->columns[c].components;
        if (!out)
            continue;
        if (level == cursor->level && cursor->exact)
            memcpy(out, cursor->columns[c].values, count * n * sizeof *out);
        else
            values_before(cursor, &cursor->columns[c], cursor->records[level], count, out);
        for (uint32_t v = count; v < replay->vertices; v++) // a parent has a lower number: it is done
            memcpy(out + v * n, out + replay->parents[v] * n, n * sizeof *out);
    }
    return TETLOD_OK;
}
