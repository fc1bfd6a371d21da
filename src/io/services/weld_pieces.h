/* SPDX-License-Identifier: BSD-3-Clause */
/* Which points of pieces are one, where a piece has several at one place: on both sides of a crack, or of bodies that
 * touch. */
#ifndef TETLOD_WELD_PIECES_H
#define TETLOD_WELD_PIECES_H

#include "src/io/services/assemble.h"

/* Of a point the piece that it is of, and whether that is a grid, whose own seams are closed. */
static inline uint32_t weld_origin(size_t piece, bool is_grid)
{
    return (uint32_t)(2 * piece + is_grid);
}

/* io_target[vertex] comes in as the least point of the same place and values. Where these are several of one piece the
 * points of different pieces stay joined through faces alone: a corner of a face becomes that of the other piece's face
 * at the same place. So nothing inside a piece is glued. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status weld_untie(const struct block *block, const uint32_t *origins, uint32_t *io_target,
                                             struct tetlod_error *error);

#endif
