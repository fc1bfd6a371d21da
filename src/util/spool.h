/* SPDX-License-Identifier: BSD-3-Clause */
/* A temporary file without a name, in the folder that TMPDIR names or in /tmp: written from front to back, then read
 * anywhere. */
#ifndef TETLOD_SPOOL_H
#define TETLOD_SPOOL_H

#include <stdbool.h>
#include <stdio.h>

#include "format/tetlod.h"

struct spool {
    FILE *file;
    uint64_t size; /* written so far */
};

/* The folder's name. */
const char *spool_folder(void);

/* Is the folder itself in memory, so that files there save none? */
bool spool_in_memory(void);

/* A file without a name in it, to write and to read, or -1 and errno. */
int spool_file(void);

/* ERR_IO names the folder. A spool of zeros may be closed, too. */
TETLOD_CHECKED enum tetlod_status spool_open(struct spool *out, struct tetlod_error *error);
void spool_close(struct spool *spool);

TETLOD_CHECKED enum tetlod_status spool_write(struct spool *spool, const void *bytes, size_t size,
                                              struct tetlod_error *error);

/* All that is written, for as long as the spool is open. Any number of threads may read it. */
TETLOD_CHECKED enum tetlod_status spool_source(struct spool *spool, struct tetlod_source *out,
                                               struct tetlod_error *error);

#endif
