/* SPDX-License-Identifier: BSD-3-Clause */
/* A mesh that lies in pieces, of which several programs read some each. */
#ifndef TETLOD_PIECES_H
#define TETLOD_PIECES_H

#include "src/io/services/assemble.h"
#include "src/util/work_share.h"

struct piece_list {
    uint32_t count;
    /* Adds the blocks of a piece, or a range of one (goes_on). What it says in *report is added to what others say. */
    enum tetlod_status (*read)(void *opaque, uint32_t piece, struct blocks *out, const struct io_input *input,
                               struct io_report *report, struct tetlod_error *error);
    void *opaque;
};

/* How many ranges of a block of so many cells are worth being read by programs of their own; 1: it is one piece. */
uint32_t pieces_ranges(const struct io_read_options *options, uint64_t cells);

/* Where the range begins of `count` things; the next one where it ends. */
uint64_t range_begin(uint64_t count, uint32_t range, uint32_t ranges);

/* Adds the blocks of all pieces, in their order, whoever has read them. Of a helper: TETLOD_MORE, when it has done its
 * part; it gets none. */
TETLOD_CHECKED enum tetlod_status pieces_read(const struct piece_list *list, struct blocks *out,
                                              const struct io_input *input, struct io_report *report,
                                              struct tetlod_error *error);

#endif
