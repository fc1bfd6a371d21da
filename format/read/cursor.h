/* SPDX-License-Identifier: BSD-3-Clause */
/* A cursor, as what moves it and what looks at it see it. Not installed. */
#ifndef TETLOD_CURSOR_H
#define TETLOD_CURSOR_H

#include "format/read/cursor_state.h"

static inline int is_tail(const struct tetlod_cursor *cursor, uint32_t level)
{
    return cursor->file->index.tail && level + 1 == cursor->file->index.info.level_count;
}

/* The finest level that there is: without all pages there is no tail. */
static inline uint32_t finest_level(const struct tetlod_cursor *cursor)
{
    return cursor->choice ? cursor->choice->finest : cursor->file->index.info.level_count - 1;
}

/* Makes stars of the mesh as it is, where pages were decoded without them. */
TETLOD_CHECKED enum tetlod_status tetlodi_cursor_stars(struct tetlod_cursor *cursor, struct tetlod_error *error);

/* Forgets what the log holds beyond the present, which is decoded anew. */
void tetlodi_cursor_forget(struct tetlod_cursor *cursor);

/* Room for a mesh and its columns. */
TETLOD_CHECKED enum tetlod_status tetlodi_cursor_room(struct tetlod_cursor *cursor, uint32_t vertices, uint32_t tets,
                                                      struct tetlod_error *error);

/* Bytes of a column's frame of a level, or of one of its pages. */
uint64_t tetlodi_cursor_frame(const struct tetlod_cursor *cursor, uint32_t level, uint32_t page, uint32_t column);

/* All pages from now on. */
void tetlodi_choice_free(struct tetlod_cursor *cursor);

/* Goes to a level that is decoded. */
TETLOD_CHECKED enum tetlod_status tetlodi_cursor_go_to(struct tetlod_cursor *cursor, uint32_t level,
                                                       struct tetlod_error *error);

/* What a level could not be decoded for: remembers it, if that is not that its bytes could not be read. */
enum tetlod_status tetlodi_cursor_fail(struct tetlod_cursor *cursor, uint32_t level, enum tetlod_status status,
                                       const struct tetlod_error *inner, struct tetlod_error *error);

#endif
