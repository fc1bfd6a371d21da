/* SPDX-License-Identifier: BSD-3-Clause */
/* Memory that work is granted as it goes on: each part asks before it allocates. A room that is NULL has no limit. */
#ifndef TETLOD_ROOM_H
#define TETLOD_ROOM_H

#include <stddef.h>
#include <stdint.h>

#include "format/tetlod.h"

struct room {
    /* Grants this much in all. On failure nothing is granted, and the work frees what it has. */
    enum tetlod_status (*grant)(struct room *room, uint64_t bytes, struct tetlod_error *error);
    uint64_t held;    /* bytes that the parts hold now, at most */
    uint64_t granted; /* bytes that they may hold */
};

/* Asks for more. What fails leaves the room as it was. */
TETLOD_CHECKED enum tetlod_status room_take(struct room *room, uint64_t bytes, struct tetlod_error *error);

/* What is held; and a number that is held now, which is no more than before. */
uint64_t room_held(const struct room *room);
void room_back_to(struct room *room, uint64_t held);

/* Like array_reserve, with at most `most` elements if that is enough. While an array grows, the old one counts too. */
TETLOD_CHECKED enum tetlod_status room_reserve(struct room *room, void **array, size_t *capacity, size_t needed,
                                               size_t most, size_t element_size, struct tetlod_error *error);

#endif
