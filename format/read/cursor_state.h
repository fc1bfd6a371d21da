/* SPDX-License-Identifier: BSD-3-Clause */
/* What a cursor holds. Not installed. */
#ifndef TETLOD_CURSOR_STATE_H
#define TETLOD_CURSOR_STATE_H

#include "format/coding/record.h"
#include "format/common/threads.h"
#include "format/read/reader.h"

/* What a page has in the log. */
struct tetlodi_page_log {
    uint32_t records;
    uint64_t labels;
};

/* Of a cursor with some of the pages: between two calls its levels and its log are those of the pages that it has.
 * Programs that never select pages do not hold what does it: it is called from here. */
struct tetlodi_choice {
    enum tetlod_status (*choose)(struct tetlod_cursor *cursor, const uint8_t *pages, struct tetlod_error *error);
    enum tetlod_status (*bring)(struct tetlod_cursor *cursor, uint32_t *vertices, struct tetlod_error *error);
    uint8_t *has, *wanted;   /* [page] it has no other than those that are wanted */
    uint32_t finest;         /* level with a page that is wanted */
    uint32_t next;           /* the first level of which a page is to come; TETLOD_NONE: none */
    struct tetlodi_page_log *logs; /* [page] */
    size_t root_labels;      /* in the log before all pages */
    uint32_t *page_of;       /* [tet] the last page that it was in, of all; TETLOD_NONE: none */
    size_t page_of_capacity;
};

struct tetlod_cursor {
    struct tetlod_file *file; /* borrowed */
    struct tetlodi_memory memory;
    struct tetlodi_column *columns; /* positions, then the selected fields */
    uint32_t *parts;                /* [column] the part of each level that holds it */
    const double **fields;          /* [field_count] for tetlod_cursor_mesh */
    struct tetlodi_replay replay;
    struct tetlodi_recorder recorder;
    uint32_t *records; /* [level] in the log at the level's end, as far as decoded */
    /* [level] that it has, as far as it is known: only with some pages others than the index's */
    uint32_t *vertices, *tets;
    uint32_t loading, loading_page; /* the level whose frames are being read, and its page; TETLOD_NONE: all of it */
    int unread; /* the frames that were asked for last could not be read */
    uint32_t level, decoded; /* the current level, or the one below; the finest in the log */
    uint32_t decoding_level; /* that was begun and is not whole; 0: none */
    struct tetlodi_helpers *helpers; /* while tetlod_cursor_seek decodes; NULL: none */
    struct tetlodi_field_log *decoding; /* what fields are being decoded from; NULL: nothing, and both logs are empty */
    struct tetlod_error *errors;     /* [column] of tasks */
    uint8_t **frames;          /* [column] of the level or page that is being decoded, if any */
    uint64_t frame_bytes;      /* theirs */
    const struct tetlodi_group *group; /* of pages, that is being decoded; NULL: the level has none */
    struct tetlodi_page_lists lists;   /* the group's */
    int starless;            /* the replay's stars are not those of its mesh */
    uint32_t next_page;      /* the page after the one that is being decoded */
    struct tetlodi_choice *choice; /* some of the pages; NULL: levels have all of them */
    int exact;               /* fields have the tail's values: level is the last */
    enum tetlod_status broken; /* why no level above `decoded` can be had */
    struct tetlod_error damage;
};

#endif
