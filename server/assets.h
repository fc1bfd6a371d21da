/* SPDX-License-Identifier: BSD-3-Clause */
/* Files that are part of the program: the page and what it loads. */
#ifndef TETLOD_SERVER_ASSETS_H
#define TETLOD_SERVER_ASSETS_H

#include "server/buffer.h"

/* Generated from a folder by embed.py. */
struct embedded_file {
    const char *path; /* "/", "/page.css", ... */
    const char *media_type;
    const unsigned char *bytes, *end;
};

extern const struct embedded_file embedded_files[];
extern const size_t embedded_file_count;

/* A file in all codings in which it is smaller than as it is. */
struct asset {
    const struct embedded_file *file;
    struct buffer encoded[CODINGS]; /* identity stays empty */
    char etag[24];
};

struct assets;

/* NULL if memory is out. */
struct assets *assets_new(void);
void assets_free(struct assets *assets);

const struct asset *assets_find(const struct assets *assets, const char *path);

#endif
