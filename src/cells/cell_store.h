/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Where the cells of a phase wait until all are contracted: as they are in memory, or as bytes in a temporary file.
 * What else can keep bytes under a number, such as a folder that several programs share, can be a store as well.
 */
#ifndef TETLOD_CELL_STORE_H
#define TETLOD_CELL_STORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "format/tetlod.h"

struct cell_store {
    /* Keeps bytes under the number of a cell; several threads call it. */
    enum tetlod_status (*put)(void *opaque, uint32_t cell, const void *bytes, size_t size, struct tetlod_error *error);
    /* Gives them back, or the first ones, `enough` at least, in a block that the caller frees. */
    enum tetlod_status (*get)(void *opaque, uint32_t cell, size_t enough, unsigned char **out, size_t *size,
                              struct tetlod_error *error);
    void *opaque;
};

/* A store of `cells` cells in a temporary file (src/util/spool.h). ERR_NOMEM, ERR_IO. */
TETLOD_CHECKED enum tetlod_status cell_spool_new(struct cell_store *out, uint32_t cells, struct tetlod_error *error);

/* Takes a store of zeros, too. */
void cell_spool_free(struct cell_store *store);

#endif
