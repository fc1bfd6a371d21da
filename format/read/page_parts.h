/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A level in pages, decoded on several threads (SPEC 7.6): pages of a level touch no tetrahedron of each other, so each
 * is decoded as a small mesh of its own, whose numbers are its own, and put back. The result is that of one thread. Not
 * installed.
 */
#ifndef TETLOD_PAGE_PARTS_H
#define TETLOD_PAGE_PARTS_H

#include "format/coding/page_part.h"
#include "format/read/cursor_state.h"

/* Pages that come to others, which are there: both [page of all groups]. */
struct tetlodi_coming {
    const uint8_t *pages; /* of the level */
    const uint8_t *next;  /* these and the others; the mesh is open for them (format/read/page_runs.h) */
};

/* Levels that are decoded together: their groups have one tree. */
struct tetlodi_levels {
    uint32_t first, count;
    uint64_t max_labels[MAX_ALIKE]; /* that the records up to each may have */
};

/* Decodes pages of levels that have begun, whose counts are known and for which there is room: all (coming NULL), or
 * some, of one level. The cursor's log is at its end. Afterwards stars are those of no mesh: tetlodi_replay_restar. On
 * failure the mesh is as it was, but for stars; of several levels the first may be good then. */
TETLOD_CHECKED enum tetlod_status tetlodi_decode_pages(struct tetlod_cursor *cursor,
                                                       const struct tetlodi_levels *levels,
                                                       const struct tetlodi_coming *coming,
                                                       struct tetlod_error *error);

#endif
