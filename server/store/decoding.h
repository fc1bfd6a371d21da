/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A stream on its way into memory: decoded once somebody asks for a level, in one thread at a time. Others wait for the
 * level that they need, not for the whole stream; a level that is there is found without a lock.
 */
#ifndef TETLOD_SERVER_DECODING_H
#define TETLOD_SERVER_DECODING_H

#include "server/store/forest.h"
#include "server/store/waiter.h"

struct decoding;

/* NULL if memory is out. The file is borrowed. */
struct decoding *decoding_new(struct tetlod_file *file);
void decoding_free(struct decoding *decoding);

/* The stream in memory if the level is there, else NULL. */
const struct forest *decoding_find(const struct decoding *decoding, uint32_t level);

enum decoding_state {
    DECODING_READY,  /* the level is there */
    DECODING_COMING, /* it is not; the waiter will be woken when more levels are there, or when none will come: ask again */
    DECODING_MINE,   /* the same, and the caller is to run or to cancel it */
    DECODING_FAILED, /* it did not come; told only to who `waited`: others try again */
};

/* `waiter` may be NULL. */
enum decoding_state decoding_ask(struct decoding *decoding, uint32_t level, bool waited, struct waiter *waiter,
                                 struct tetlod_error *failure);

/* Decodes up to a level, unless `stopping` says between two levels that it is no longer wanted. */
TETLOD_CHECKED enum tetlod_status decoding_run(struct decoding *decoding, uint32_t level, bool (*stopping)(void *opaque), void *opaque,
                                               struct tetlod_error *error);

void decoding_cancel(struct decoding *decoding, const struct tetlod_error *why);

/* Memory that the stream takes. */
uint64_t decoding_bytes(const struct decoding *decoding);

#endif
