/* SPDX-License-Identifier: BSD-3-Clause */
/* Files that are part of the program: the page and what it loads. Generated, with their codings, from folders by
 * embed.py. */
#ifndef TETLOD_SERVER_ASSETS_H
#define TETLOD_SERVER_ASSETS_H

#include <stdbool.h>
#include <stddef.h>

#include "server/http/coding.h"

struct embedded_bytes {
    const unsigned char *bytes, *end; /* NULL: the coding would be no smaller */
};

struct embedded_file {
    const char *path; /* "/", "/page.css", ... */
    const char *media_type;
    const char *hash; /* of the content, hex */
    bool named_by_content; /* another content has another path */
    struct embedded_bytes coded[CODINGS];
};

extern const struct embedded_file embedded_files[];
extern const size_t embedded_file_count;

/* NULL if there is none. */
const struct embedded_file *assets_find(const char *path);

#endif
