/* SPDX-License-Identifier: BSD-3-Clause */
/* What a cursor shows of its mesh, and of how it differs from other levels'. */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "format/read/cursor.h"

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
    uint32_t count = cursor->vertices[level];
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

/* The vertices below `count` that records from number `records` on split. */
static void mark_split(const struct tetlod_cursor *cursor, uint32_t records, uint32_t count, uint8_t *marks)
{
    const struct tetlodi_replay *replay = &cursor->replay;
    for (uint32_t split = replay->splits, record = replay->records; record > records;) {
        const struct tetlodi_split *log = &replay->log[--split];
        if (!(log->tets & SPLIT_FIRST))
            continue;
        record--;
        if (log->vertex < count)
            marks[log->vertex] = 1;
    }
}

enum tetlod_status tetlod_cursor_changes(const struct tetlod_cursor *cursor, uint32_t level, uint32_t *vertices,
                                         uint32_t *vertex_count,
                                         uint32_t *tets, uint32_t *tet_count, struct tetlod_error *error)
{
    if (level > cursor->level)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "level %u is finer than the cursor's %u", level, cursor->level);
    uint32_t count = cursor->vertices[level];
    uint8_t *marks = calloc(count, 1);
    if (!marks)
        return tetlodi_fail_nomem(error, "a list of changes", count);
    if (cursor->exact && !is_tail(cursor, level))
        memset(marks, 1, count);
    mark_split(cursor, cursor->records[level], count, marks);
    *vertex_count = *tet_count = 0;
    for (uint32_t v = 0; v < count; v++)
        if (marks[v])
            vertices[(*vertex_count)++] = v;
    free(marks);
    /* A corner changes from a vertex to one of its children, which the level does not have. */
    for (uint32_t t = 0; t < cursor->tets[level]; t++) {
        const uint32_t *c = cursor->replay.corners + 4 * (size_t)t;
        if (c[0] >= count || c[1] >= count || c[2] >= count || c[3] >= count)
            tets[(*tet_count)++] = t;
    }
    return TETLOD_OK;
}

enum tetlod_status tetlod_cursor_floats(const struct tetlod_cursor *cursor, uint32_t field, uint32_t first,
                                        uint32_t count, float *out,
                                        struct tetlod_error *error)
{
    uint32_t part = field == TETLOD_NONE ? 0 : field + 1, column = 0;
    while (column < cursor->replay.column_count && cursor->parts[column] != part)
        column++;
    if (column == cursor->replay.column_count)
        return tetlodi_fail(error, TETLOD_ERR_FIELD, "the cursor has no field number %u", field);
    if (first > cursor->replay.vertices || count > cursor->replay.vertices - first)
        return tetlodi_fail(error, TETLOD_ERR_ARGUMENT, "there are %u vertices, not %u from number %u on",
                            cursor->replay.vertices, count, first);
    size_t n = cursor->columns[column].components;
    const double *values = cursor->columns[column].values + first * n;
    for (size_t i = 0; i < count * n; i++)
        out[i] = (float)values[i];
    return TETLOD_OK;
}

/* Puts the one's insides into the other. What points into a cursor follows. */
static void exchange(struct tetlod_cursor *a, struct tetlod_cursor *b)
{
    struct tetlod_cursor was = *a;
    *a = *b;
    *b = was;
    struct tetlod_cursor *both[2] = {a, b};
    for (int i = 0; i < 2; i++) {
        both[i]->replay.memory = &both[i]->memory;
        both[i]->recorder.replay = &both[i]->replay;
        both[i]->recorder.log = both[i]->recorder.log ? both[i]->recorder.logs : NULL; // both are empty
    }
}

enum tetlod_status tetlod_cursor_add_field(struct tetlod_cursor *cursor, uint32_t field, struct tetlod_error *error)
{
    uint32_t count = cursor->replay.column_count, *fields = malloc((count + (size_t)1) * sizeof *fields);
    struct tetlod_cursor *other = NULL;
    enum tetlod_status status;
    if (!fields)
        return tetlodi_fail_nomem(error, "a cursor", (count + (uint64_t)1) * sizeof *fields);
    for (uint32_t c = 1; c < count; c++)
        fields[c - 1] = cursor->parts[c] - 1;
    fields[count - 1] = field;
    TETLOD_TRY_DONE(tetlod_cursor_new(&other, cursor->file, fields, count, error));
    if (cursor->choice)
        TETLOD_TRY_DONE(cursor->choice->choose(other, cursor->choice->has, error));
    TETLOD_TRY_DONE(tetlod_cursor_seek(other, cursor->level, error));
    while (other->replay.records < cursor->replay.records)
        TETLOD_TRY_DONE(tetlod_cursor_refine(other, error));
    while (other->replay.records > cursor->replay.records) // pages come whole
        TETLOD_TRY_DONE(tetlod_cursor_coarsen(other, error));
    if (cursor->choice)
        TETLOD_TRY_DONE(cursor->choice->choose(other, cursor->choice->wanted, error));
    exchange(cursor, other);
done:
    tetlod_cursor_free(other);
    free(fields);
    return status;
}
