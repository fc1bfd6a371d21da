/* SPDX-License-Identifier: BSD-3-Clause */
/* Levels that questions were asked of, kept in the site's memory for the next question. */
#ifndef TETLOD_SERVER_KEPT_LEVELS_H
#define TETLOD_SERVER_KEPT_LEVELS_H

#include "server/store/cache.h"
#include "src/ask/ask.h"

enum { MAX_KEPT_LEVELS = 32 };

/* What one question holds of them. */
struct kept_levels {
    struct cache *memory;
    const char *cid; /* of the stream */
    struct cache_entry *held[MAX_KEPT_LEVELS];
    unsigned count;
    struct ask_shelf shelf; /* for the question's options */
};

void kept_levels_begin(struct kept_levels *kept, struct cache *memory, const char *cid);
void kept_levels_end(struct kept_levels *kept);

#endif
