/* SPDX-License-Identifier: BSD-3-Clause */
/* A catalogue as plain files, for servers that only send files. */
#ifndef TETLOD_EXPLODE_H
#define TETLOD_EXPLODE_H

#include "format/tetlod.h"

struct explode_options {
    const char *folder;       /* made if it is not there */
    const char *const *paths; /* as for a server */
    size_t path_count;
    int meshes; /* also every level as VTU */
    int viewer; /* also the page */
};

/* Writes what a server over these paths would answer as files at the same paths below the folder, for plain file
 * servers: descriptions (as index.json), streams, base meshes, records from each level to the next. */
TETLOD_CHECKED enum tetlod_status explode(const struct explode_options *options, struct tetlod_error *error);

#endif
