/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Where a cursor with some of the pages has what each page adds: one run of vertices, of tetrahedra and of the log, in
 * the order of pages, behind the root's. Runs move together where a page is taken out, and apart where one comes. Not
 * installed.
 */
#ifndef TETLOD_PAGE_RUNS_H
#define TETLOD_PAGE_RUNS_H

#include "format/coding/page_part.h"
#include "format/read/cursor_state.h"

/* Where the root's log ends. */
struct tetlodi_log_place tetlodi_log_of_root(const struct tetlod_cursor *cursor);

/* Neighbours that move alike. */
struct tetlodi_run {
    size_t from, to, count;
};

struct tetlodi_runs {
    struct tetlodi_run *list;
    uint32_t count;
    size_t before, after; /* in all */
};

/* From where everything is with some pages to where it is with others. */
struct tetlodi_moves {
    struct tetlodi_runs vertices, tets, records, labels;
    uint32_t *numbers; /* [vertex before] afterwards */
    uint8_t *bits;     /* labels, on the way */
};

/* Moves of the mesh, or of the log, from the cursor's pages to others. 0 if out of memory. */
int tetlodi_moves_of_mesh(struct tetlodi_moves *moves, const struct tetlod_cursor *cursor, const uint8_t *to);
int tetlodi_moves_of_log(struct tetlodi_moves *moves, const struct tetlod_cursor *cursor, const uint8_t *to);
void tetlodi_moves_fini(struct tetlodi_moves *moves);

/* The way back of the mesh. */
void tetlodi_moves_turn(struct tetlodi_moves *moves);

/* There is room. up: [vertex] of one that goes the one that it was split from; NULL: none goes. */
void tetlodi_move_mesh(struct tetlod_cursor *cursor, const struct tetlodi_moves *moves, const uint32_t *up);
void tetlodi_move_log(struct tetlod_cursor *cursor, const struct tetlodi_moves *moves);

#endif
