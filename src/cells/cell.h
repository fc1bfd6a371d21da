/* SPDX-License-Identifier: BSD-3-Clause */
/* A cell of a phase: what was done to it, and what is left of it. As bytes it can wait elsewhere, or be sent. */
#ifndef TETLOD_CELL_H
#define TETLOD_CELL_H

#include "src/simplify/piece.h"
#include "src/util/buffer.h"

enum cell_stage { CELL_CATCH_UP, CELL_GO_ON, CELL_STAGES };

struct cell {
    uint32_t *vertices; /* [vertex of the piece] in what is cut; NULL: the same numbers */
    struct piece piece;
    struct contraction_log logs[CELL_STAGES];
    uint32_t firsts[CELL_STAGES]; /* of the whole log: its first contraction of each stage */
    uint32_t *nodes;              /* [vertex after catching up] in logs[CELL_CATCH_UP]; NULL: it did not */
    uint32_t tets;                /* before */
    enum tetlod_status status;
    struct tetlod_error error;
};

void cell_fini(struct cell *cell);

/* Frees all but what the logs say of their marks, their counts and components. */
void cell_drop(struct cell *cell);

/* Appends all that a cell is but `firsts`, status and error. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cell_pack(const struct cell *cell, struct buffer *out, struct tetlod_error *error);

/* The same of a cell that is to be contracted: its piece and its vertices. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status cell_pack_start(const struct cell *cell, struct buffer *out,
                                                  struct tetlod_error *error);
TETLOD_CHECKED enum tetlod_status cell_unpack_start(struct cell *out, const struct piece *like,
                                                    const unsigned char *bytes, size_t size,
                                                    struct tetlod_error *error);

/* The cell again: `like` is a piece of the same mesh. ERR_NOMEM; ERR_IO: the bytes are of something else. Then *out is
 * to be freed. */
TETLOD_CHECKED enum tetlod_status cell_unpack(struct cell *out, const struct piece *like, const unsigned char *bytes,
                                              size_t size, struct tetlod_error *error);

/* What of a cell is left when it is dropped, of the first of its bytes. ERR_NOMEM; ERR_IO: there are too few, or of
 * something else. Then *out is to be freed. */
TETLOD_CHECKED enum tetlod_status cell_unpack_head(struct cell *out, const unsigned char *bytes, size_t size,
                                                   struct tetlod_error *error);

/* Does each of its numbers refer to what is there, in a cell of a mesh of so many vertices? One that has been unpacked
 * may be forged. */
bool cell_fits(const struct cell *cell, uint32_t vertices);

#endif
