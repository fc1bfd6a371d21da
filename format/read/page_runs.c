/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/read/page_runs.h"

#include <stdlib.h>
#include <string.h>

enum kind { VERTICES, TETS, RECORDS, LABELS };

struct tetlodi_log_place tetlodi_log_of_root(const struct tetlod_cursor *cursor)
{
    uint32_t root = cursor->file->index.pages.first_level - 1;
    return (struct tetlodi_log_place){cursor->vertices[root] - cursor->vertices[0], cursor->records[root],
                                      cursor->choice->root_labels};
}

static size_t of_root(const struct tetlod_cursor *cursor, enum kind kind)
{
    const struct tetlodi_log_place log = tetlodi_log_of_root(cursor);
    uint32_t root = cursor->file->index.pages.first_level - 1;
    const size_t amounts[] = {cursor->vertices[root], cursor->tets[root], log.record, log.label};
    return amounts[kind];
}

static size_t of_page(const struct tetlod_cursor *cursor, uint32_t page, enum kind kind)
{
    const struct tetlodi_page *row = &cursor->file->index.pages.pages[page];
    const struct tetlodi_page_log *log = &cursor->choice->logs[page];
    const size_t amounts[] = {row->vertices, row->tets, log->records, (size_t)log->labels};
    return amounts[kind];
}

/* What stays, in order. */
static bool make_runs(const struct tetlod_cursor *cursor, const uint8_t *to, enum kind kind, struct tetlodi_runs *out)
{
    const uint8_t *from = cursor->choice->has;
    uint32_t pages = cursor->file->index.pages.page_count;
    size_t root = of_root(cursor, kind);
    *out = (struct tetlodi_runs){malloc((pages + (size_t)1) * sizeof *out->list), 1, root, root};
    if (!out->list)
        return false;
    out->list[0] = (struct tetlodi_run){0, 0, root};
    for (uint32_t p = 0; p < pages; p++) {
        size_t amount = of_page(cursor, p, kind);
        struct tetlodi_run *last = &out->list[out->count - 1];
        bool stays = from[p] && to[p];
        if (stays && last->from + last->count == out->before && last->to + last->count == out->after)
            last->count += amount;
        else if (stays)
            out->list[out->count++] = (struct tetlodi_run){out->before, out->after, amount};
        out->before += from[p] ? amount : 0;
        out->after += to[p] ? amount : 0;
    }
    return true;
}

/* Of an array without its first elements, which stay. */
static void move_runs(void *array, size_t size, size_t skipped, const struct tetlodi_runs *runs)
{
    char *bytes = array;
    for (uint32_t i = 1; i < runs->count; i++) {
        const struct tetlodi_run *run = &runs->list[i];
        if (run->to < run->from)
            memmove(bytes + (run->to - skipped) * size, bytes + (run->from - skipped) * size, run->count * size);
    }
    for (uint32_t i = runs->count; i-- > 1;) {
        const struct tetlodi_run *run = &runs->list[i];
        if (run->to > run->from)
            memmove(bytes + (run->to - skipped) * size, bytes + (run->from - skipped) * size, run->count * size);
    }
}

/* The new number of each vertex: of one that goes that of what it was split from, which is before it. */
static void find_numbers(const struct tetlodi_runs *runs, const uint32_t *up, uint32_t *numbers)
{
    size_t v = 0;
    for (uint32_t i = 0; i <= runs->count; i++) {
        size_t from = i < runs->count ? runs->list[i].from : runs->before;
        for (; v < from; v++)
            numbers[v] = up ? numbers[up[v]] : 0;
        for (; i < runs->count && v < from + runs->list[i].count; v++)
            numbers[v] = (uint32_t)(runs->list[i].to + (v - from));
    }
}

/* All that stays: of what is not there yet, or no longer, there are no numbers. */
static void renumber(struct tetlodi_replay *replay, const struct tetlodi_runs *vertices, const uint32_t *numbers,
                     const uint32_t *page_of, size_t tets)
{
    size_t base = vertices->before - replay->splits;
    for (size_t t = 0; t < tets; t++) {
        uint32_t *corners = replay->corners + 4 * t;
        if (page_of[t] == NOT_THERE)
            continue;
        for (int c = 0; c < 4; c++)
            corners[c] = numbers[corners[c]];
    }
    for (uint32_t i = 1; i < vertices->count; i++)
        for (size_t v = vertices->list[i].from, end = v + vertices->list[i].count; v < end; v++) {
            replay->parents[v] = numbers[replay->parents[v]];
            if (v >= base)
                replay->log[v - base].vertex = numbers[replay->log[v - base].vertex];
        }
}

static void move_vertices(struct tetlodi_replay *replay, const struct tetlodi_runs *runs)
{
    for (uint32_t c = 0; c < replay->column_count; c++) {
        struct tetlodi_column *column = &replay->columns[c];
        move_runs(column->codes, column->components * sizeof *column->codes, 0, runs);
        move_runs(column->values, column->components * sizeof *column->values, 0, runs);
    }
    move_runs(replay->parents, sizeof *replay->parents, 0, runs);
    move_runs(replay->stars, sizeof *replay->stars, 0, runs);
    move_runs(replay->log, sizeof *replay->log, runs->before - replay->splits, runs);
}

static void move_tets(struct tetlod_cursor *cursor, const struct tetlodi_runs *runs)
{
    uint32_t *page_of = cursor->choice->page_of;
    size_t t = 0;
    move_runs(cursor->replay.corners, 4 * sizeof *cursor->replay.corners, 0, runs);
    move_runs(page_of, sizeof *page_of, 0, runs);
    for (uint32_t i = 0; i <= runs->count; i++) {
        for (size_t to = i < runs->count ? runs->list[i].to : runs->after; t < to; t++)
            page_of[t] = NOT_THERE;
        t += i < runs->count ? runs->list[i].count : 0;
    }
}

int tetlodi_moves_of_mesh(struct tetlodi_moves *moves, const struct tetlod_cursor *cursor, const uint8_t *to)
{
    if (!make_runs(cursor, to, VERTICES, &moves->vertices) || !make_runs(cursor, to, TETS, &moves->tets))
        return 0;
    size_t most = moves->vertices.before > moves->vertices.after ? moves->vertices.before : moves->vertices.after;
    moves->numbers = malloc((most + 1) * sizeof *moves->numbers);
    return moves->numbers != NULL;
}

int tetlodi_moves_of_log(struct tetlodi_moves *moves, const struct tetlod_cursor *cursor, const uint8_t *to)
{
    moves->bits = calloc(cursor->replay.labels_capacity + 1, 1);
    return moves->bits && make_runs(cursor, to, RECORDS, &moves->records) &&
           make_runs(cursor, to, LABELS, &moves->labels);
}

void tetlodi_moves_fini(struct tetlodi_moves *moves)
{
    free(moves->vertices.list);
    free(moves->tets.list);
    free(moves->records.list);
    free(moves->labels.list);
    free(moves->numbers);
    free(moves->bits);
}

static void turn(struct tetlodi_runs *runs)
{
    size_t before = runs->before;
    runs->before = runs->after;
    runs->after = before;
    for (uint32_t i = 0; i < runs->count; i++) {
        size_t from = runs->list[i].from;
        runs->list[i].from = runs->list[i].to;
        runs->list[i].to = from;
    }
}

void tetlodi_moves_turn(struct tetlodi_moves *moves)
{
    turn(&moves->vertices);
    turn(&moves->tets);
}

void tetlodi_move_mesh(struct tetlod_cursor *cursor, const struct tetlodi_moves *moves, const uint32_t *up)
{
    struct tetlodi_replay *replay = &cursor->replay;
    find_numbers(&moves->vertices, up, moves->numbers);
    renumber(replay, &moves->vertices, moves->numbers, cursor->choice->page_of, moves->tets.before);
    move_vertices(replay, &moves->vertices);
    move_tets(cursor, &moves->tets);
    replay->splits += (uint32_t)(moves->vertices.after - moves->vertices.before);
    replay->vertices = (uint32_t)moves->vertices.after;
    replay->tets = (uint32_t)moves->tets.after;
    cursor->starless = 1;
}

void tetlodi_move_log(struct tetlod_cursor *cursor, const struct tetlodi_moves *moves)
{
    struct tetlodi_replay *replay = &cursor->replay;
    for (uint32_t c = 0; c < replay->column_count; c++) {
        struct tetlodi_column *column = &replay->columns[c];
        move_runs(column->before, column->components * sizeof *column->before, 0, &moves->records);
    }
    for (uint32_t i = 0; i < moves->labels.count; i++) {
        const struct tetlodi_run *run = &moves->labels.list[i];
        tetlodi_labels_copy(moves->bits, run->to, replay, run->from, run->count);
    }
    if (replay->labels_capacity)
        memcpy(replay->labels, moves->bits, replay->labels_capacity);
}
