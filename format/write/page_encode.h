/* SPDX-License-Identifier: BSD-3-Clause */
/* The pages of a level as they are written (SPEC 7.6), on several threads. Not installed. */
#ifndef TETLOD_PAGE_ENCODE_H
#define TETLOD_PAGE_ENCODE_H

#include "format/write/page_write.h"
#include "format/write/record_write.h"

struct tetlodi_page_encode {
    struct tetlodi_record_writer *whole;
    struct tetlodi_page_writer *pages;  /* that has begun with the group */
    const struct tetlodi_write_group *group;
    uint32_t contractions;              /* of the level */
    /* no level follows: of the mesh only the nodes are asked for, columns with exact values, and what this says */
    bool ends, keeps_tets;
    unsigned slowest;
    struct tetlodi_buffer *frames;      /* [column] of the level, which are appended to */
    struct tetlodi_helpers *helpers;    /* or NULL */
    enum tetlod_status (*ask)(void *opaque); /* behind each page, on the caller's thread */
    void *opaque;
};

/* Encodes all pages of the group, with their boxes, and puts them into the mesh, whose stars are of no use before and
 * after. ERR_ARGUMENT, ERR_NOMEM, or what was asked. */
TETLOD_CHECKED enum tetlod_status tetlodi_encode_pages(const struct tetlodi_page_encode *encode,
                                                       struct tetlod_error *error);

#endif
