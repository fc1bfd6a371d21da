/* SPDX-License-Identifier: BSD-3-Clause */
/* A cursor with some of the pages (SPEC 7.6): others come, and some go. Not installed. */
#ifndef TETLOD_PAGE_CHOICE_H
#define TETLOD_PAGE_CHOICE_H

#include "format/read/cursor_state.h"

/* Which pages a cursor is to have from now on: [page of all groups], a closed set; NULL: all. Those that it has and
 * that are not among them go at once; those that it has not come when they are asked for. */
TETLOD_CHECKED enum tetlod_status tetlodi_cursor_choose(struct tetlod_cursor *cursor, const uint8_t *pages,
                                                        struct tetlod_error *error);

#endif
