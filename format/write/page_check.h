/* SPDX-License-Identifier: BSD-3-Clause */
/* Holds the table of pages against what is decoded (SPEC 7.6, 16). Not installed. */
#ifndef TETLOD_PAGE_CHECK_H
#define TETLOD_PAGE_CHECK_H

#include "format/tetlod.h"

/* Decodes all levels in pages and makes their table anew: it has to be the stream's. A stream without pages is right.
 * ERR_STREAM, or as a cursor. */
TETLOD_CHECKED enum tetlod_status tetlodi_check_pages(struct tetlod_file *file, struct tetlod_error *error);

#endif
