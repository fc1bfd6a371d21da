/* SPDX-License-Identifier: BSD-3-Clause */
/* The section PAGE, read (SPEC 7.6). Not installed. */
#ifndef TETLOD_PAGE_DECODE_H
#define TETLOD_PAGE_DECODE_H

#include "format/coding/page_table.h"

/* Sets the table from the section of a stream of so many levels without the tail. The caller checks that pages
 * give their levels. ERR_STREAM, ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status tetlodi_page_table_decode(struct tetlodi_page_table *table, uint32_t levels,
                                                            uint32_t field_count, const uint8_t *bytes, size_t size,
                                                            struct tetlod_error *error);

#endif
