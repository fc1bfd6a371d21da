/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/io/services/cells_twice.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* Cells of more points are not looked for. */
enum { MAX_POINTS = 8 };

/* Several pieces have the point; TETLOD_NONE: none has it. */
#define SHARED UINT32_C(0xfffffffe)

struct listed {
    uint32_t points[MAX_POINTS]; /* ascending, TETLOD_NONE behind them */
    uint64_t cell;
};

struct search {
    const struct block *block;
    const uint64_t *ends;
    uint32_t *pieces; /* [vertex] */
    uint32_t piece;   /* of the cell that is looked at */
    struct listed now;
    unsigned count;   /* of its points; more than MAX_POINTS: it is none to be listed */
    struct listed *list;
    size_t listed, capacity;
};

uint64_t *blocks_cell_ends(const struct blocks *blocks)
{
    uint64_t *ends = array_new(blocks->count, sizeof *ends);
    for (size_t b = 0; b < blocks->count && ends; b++)
        ends[b] = (b ? ends[b - 1] : 0) + block_cell_count(&blocks->at[b]);
    return ends;
}

static void visit_points(struct search *s, uint64_t cell, void (*visit)(void *opaque, uint32_t *point))
{
    const struct cells *cells = &s->block->cells;
    if (cells->types)
        cells_visit_points(cells, cell, visit, s);
    for (uint64_t i = 4 * cell; i < 4 * cell + 4 && !cells->types; i++)
        visit(s, &cells->connectivity[i]);
}

static void note_piece(void *opaque, uint32_t *point)
{
    struct search *s = opaque;
    if (*point >= s->block->mesh.vertex_count)
        return; // validating says so
    uint32_t *piece = &s->pieces[*point];
    *piece = *piece == TETLOD_NONE || *piece == s->piece ? s->piece : SHARED;
}

static void note_point(void *opaque, uint32_t *point)
{
    struct search *s = opaque;
    bool listed = s->count < MAX_POINTS && *point < s->block->mesh.vertex_count && s->pieces[*point] == SHARED;
    unsigned at = s->count;
    s->count = listed ? s->count + 1 : MAX_POINTS + 1;
    for (; listed && at > 0 && s->now.points[at - 1] > *point; at--)
        s->now.points[at] = s->now.points[at - 1];
    if (listed)
        s->now.points[at] = *point;
}

/* Lists the cell if all of its points are of several pieces. False: out of memory. */
static bool list_cell(struct search *s, uint64_t cell)
{
    if (s->block->hidden && s->block->hidden[cell])
        return true;
    memset(&s->now, 0xff, sizeof s->now); // TETLOD_NONE
    s->count = 0;
    visit_points(s, cell, note_point);
    if (s->count > MAX_POINTS)
        return true;
    s->now.cell = cell;
    return ARRAY_PUSH(s->list, s->listed, s->capacity, s->now);
}

static int compare_listed(const void *a, const void *b)
{
    const struct listed *x = a, *y = b;
    int order = memcmp(x->points, y->points, sizeof x->points);
    return order ? order : (x->cell > y->cell) - (x->cell < y->cell);
}

static size_t piece_of(const struct search *s, uint64_t cell)
{
    size_t piece = 0;
    while (cell >= s->ends[piece])
        piece++;
    return piece;
}

static enum tetlod_status fail_twice(const struct search *s, const struct listed *cell, size_t piece, size_t other,
                                     struct tetlod_error *error)
{
    double middle[3] = {0};
    unsigned count = 0;
    for (; count < MAX_POINTS && cell->points[count] != TETLOD_NONE; count++)
        for (size_t axis = 0; axis < 3; axis++)
            middle[axis] += s->block->mesh.positions[3 * (size_t)cell->points[count] + axis];
    return tetlodi_fail(error, TETLOD_ERR_MESH,
                        "pieces %zu and %zu (from 0) both have the cell at (%g, %g, %g): one of them has to mark it as "
                        "a ghost; or --drop-degenerate leaves what is there twice out",
                        piece, other, middle[0] / count, middle[1] / count, middle[2] / count);
}

static enum tetlod_status compare_all(struct search *s, struct tetlod_error *error)
{
    if (s->listed)
        qsort(s->list, s->listed, sizeof *s->list, compare_listed);
    for (size_t i = 1; i < s->listed; i++) {
        if (memcmp(s->list[i].points, s->list[i - 1].points, sizeof s->list->points) != 0)
            continue;
        size_t piece = piece_of(s, s->list[i - 1].cell), other = piece_of(s, s->list[i].cell);
        if (piece != other)
            return fail_twice(s, &s->list[i], piece, other, error);
    }
    return TETLOD_OK;
}

enum tetlod_status cells_check_twice(const struct block *block, const uint64_t *ends, size_t pieces,
                                     struct tetlod_error *error)
{
    const uint32_t vertices = block->mesh.vertex_count;
    struct search s = {.block = block, .ends = ends, .pieces = array_new(vertices, sizeof *s.pieces)};
    bool room = s.pieces;
    if (room)
        memset(s.pieces, 0xff, vertices * sizeof *s.pieces); // TETLOD_NONE
    for (uint64_t cell = 0; cell < block->cells.count && room; cell++) {
        for (; s.piece + (size_t)1 < pieces && cell >= ends[s.piece];)
            s.piece++;
        if (!block->hidden || !block->hidden[cell])
            visit_points(&s, cell, note_piece);
    }
    for (uint64_t cell = 0; cell < block->cells.count && room; cell++)
        room = list_cell(&s, cell);
    enum tetlod_status status = room ? compare_all(&s, error)
                                     : tetlodi_fail_nomem(error, "cells that are there twice", 4 * (uint64_t)vertices);
    free(s.pieces);
    free(s.list);
    return status;
}
