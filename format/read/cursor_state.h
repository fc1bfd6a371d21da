/* SPDX-License-Identifier: BSD-3-Clause */
/* What a cursor holds. Not installed. */
#ifndef TETLOD_CURSOR_STATE_H
#define TETLOD_CURSOR_STATE_H

#include "format/coding/record.h"
#include "format/common/threads.h"
#include "format/read/reader.h"

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
    uint32_t level, decoded; /* the level at hand, or the one below; the finest in the log */
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
    uint8_t *chosen;         /* [page] those that levels have; NULL: all of them */
    uint32_t chosen_level;   /* the finest with any, if not all are */
    uint32_t *left_out;      /* [tet] the level in which its page was left out; NULL if none are */
    size_t left_out_capacity;
    int exact;               /* fields have the tail's values: level is the last */
    enum tetlod_status broken; /* why no level above `decoded` can be had */
    struct tetlod_error damage;
};

#endif
