/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A level is asked in blocks of tetrahedra near each other, with their box, their volume and what their values come to:
 * a question looks only into the blocks that lie across its box, or across its threshold. A server keeps levels so. The
 * others are brought into the same blocks, so that each sum is made in one order, and all answers are the same.
 */
#ifndef TETLOD_BLOCKS_H
#define TETLOD_BLOCKS_H

#include "format/tetlod.h"

enum { BLOCK_TETS = 32 };

struct ask_block {
    double box[6], volume;
};

/* Of one component: at all corners, and over the block. */
struct ask_block_values {
    double least, most, integral, absolute;
};

/* Block b holds the tetrahedra from BLOCK_TETS * b on; the last may have fewer. */
struct ask_blocks {
    uint32_t count;
    const struct ask_block *blocks;
    const struct ask_block_values *values; /* [components * count] */
};

/* A mesh in blocks. */
struct blocked {
    uint32_t *order;   /* owned, [tets]: their numbers in the mesh */
    uint32_t *corners; /* owned, [4 * tets] */
    struct ask_block *own;
    struct ask_block_values *values;
    struct ask_blocks blocks; /* of both */
};

static inline uint32_t blocks_of(uint32_t tets)
{
    return tets / BLOCK_TETS + (tets % BLOCK_TETS > 0);
}

/* `values` NULL: there are none. ERR_NOMEM; to be released, also after a failure. */
TETLOD_CHECKED enum tetlod_status blocked_make(struct blocked *out, const double *positions, const uint32_t *corners,
                                               uint32_t tets, const double *values, uint32_t components,
                                               struct tetlod_error *error);
void blocked_fini(struct blocked *blocked);

#endif
