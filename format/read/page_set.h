/* SPDX-License-Identifier: BSD-3-Clause */
/* A closed set of pages, as a cursor sees it. Not installed. */
#ifndef TETLOD_PAGE_SET_H
#define TETLOD_PAGE_SET_H

#include "format/read/reader.h"

struct tetlod_page_set {
    const struct tetlod_file *file; /* borrowed */
    uint8_t has[];                  /* [page of all groups] */
};

#endif
