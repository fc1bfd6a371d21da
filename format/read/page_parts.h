/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A level in pages, decoded on several threads (SPEC 7.6): pages of a level touch no tetrahedron of each other, so each
 * is decoded as a small mesh of its own, whose numbers are its own, and put back. The result is that of one thread. Not
 * installed.
 */
#ifndef TETLOD_PAGE_PARTS_H
#define TETLOD_PAGE_PARTS_H

#include "format/read/cursor_state.h"

/* Pages that come to others, which are there: both [page of all groups]. */
struct tetlodi_coming {
    const uint8_t *pages; /* of the level */
    const uint8_t *next;  /* these and the others; the mesh is open for them (format/read/page_runs.h) */
};

/* Decodes pages of a level that has begun, whose counts are known and for which there is room: some (coming), or all
 * (coming NULL), and then those of levels behind it, too, up to `to`, as far as these have the same tree: *out_level is
 * the last of them. The cursor's log is at its end. Afterwards stars are those of no mesh: tetlodi_replay_restar. On
 * failure the mesh is as it was, but for stars. */
TETLOD_CHECKED enum tetlod_status tetlodi_decode_pages(struct tetlod_cursor *cursor, uint32_t level, uint32_t to,
                                                       const struct tetlodi_coming *coming, uint32_t *out_level,
                                                       struct tetlod_error *error);

#endif
