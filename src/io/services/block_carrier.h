/* SPDX-License-Identifier: BSD-3-Clause */
/* Blocks that one process has read for another: what carries their bytes is the caller's. */
#ifndef TETLOD_BLOCK_CARRIER_H
#define TETLOD_BLOCK_CARRIER_H

#include "src/io/services/assemble.h"

struct block_carrier {
    /* Sends or takes numbers of `width` bytes; each is like the one `lag` before. False: it cannot. */
    bool (*carry)(void *opaque, void *numbers, size_t count, unsigned width, unsigned lag);
    void *opaque;
    bool takes, failed;
};

/* Sends a block, whose arrays are freed one by one, so that both ends together hold it about once; or takes one, which
 * is empty before and to be freed also after a failure. False: what comes is not a block, there is no memory, or it
 * cannot be carried. */
bool block_carry(struct block_carrier *carrier, struct block *block);

#endif
