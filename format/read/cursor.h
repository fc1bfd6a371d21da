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
    return cursor->chosen ? cursor->chosen_level : cursor->file->index.info.level_count - 1;
}

/* Makes stars of the mesh as it is, where pages were decoded without them. */
TETLOD_CHECKED enum tetlod_status tetlodi_cursor_stars(struct tetlod_cursor *cursor, struct tetlod_error *error);

/* Forgets what the log holds beyond the present, which is decoded anew. */
void tetlodi_cursor_forget(struct tetlod_cursor *cursor);

/* Goes to a level that is decoded. */
TETLOD_CHECKED enum tetlod_status tetlodi_cursor_go_to(struct tetlod_cursor *cursor, uint32_t level,
                                                       struct tetlod_error *error);

/* Which pages levels have from now on ([page] of all groups; NULL: all), up to a level. What is beyond is forgotten. */
TETLOD_CHECKED enum tetlod_status tetlodi_cursor_choose(struct tetlod_cursor *cursor, const uint8_t *chosen,
                                                        uint32_t level, struct tetlod_error *error);

#endif
