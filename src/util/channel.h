/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What the program that leads passes on to its helpers (work_share.h), by one function for both ends: so what is sent
 * and what is received cannot differ. After a failure a helper goes on to receive, and drops what comes.
 */
#ifndef TETLOD_CHANNEL_H
#define TETLOD_CHANNEL_H

#include "src/util/work_share.h"

struct channel {
    const struct work_share *share;
    enum tetlod_status status; /* ERR_NOMEM: a helper has no room for an array */
};

/* Bytes that both ends have room for. They are received, even after a failure: counts are always known. */
void channel_bytes(struct channel *channel, void *bytes, size_t size);

/* An array, which a helper allocates: its address, NULL after a failure. */
void *channel_array(struct channel *channel, void *array, size_t count, size_t element_size);

/* The same of numbers of so many bytes, which are packed (packed_words.h): each is like the one `lag` before. */
void *channel_words(struct channel *channel, void *array, size_t count, size_t width, size_t lag);

#define CHANNEL_VALUE(channel, value) channel_bytes((channel), &(value), sizeof(value))
#define CHANNEL_ARRAY(channel, array, count) \
    ((array) = channel_array((channel), (array), (count), sizeof *(array)))

#define CHANNEL_WORDS(channel, array, count, lag) \
    ((array) = channel_words((channel), (array), (count), sizeof *(array), (lag)))

/* A text that may be NULL: both ends have it, a helper owns its own. */
char *channel_text(struct channel *channel, char *text);

#endif
