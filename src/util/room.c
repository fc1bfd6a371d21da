/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/util/room.h"

#include "format/fail.h"
#include "src/util/array.h"

enum tetlod_status room_take(struct room *room, uint64_t bytes, struct tetlod_error *error)
{
    if (!room)
        return TETLOD_OK;
    if (room->held + bytes > room->granted)
        TETLOD_TRY(room->grant(room, room->held + bytes, error));
    room->held += bytes;
    return TETLOD_OK;
}

uint64_t room_held(const struct room *room)
{
    return room ? room->held : 0;
}

void room_back_to(struct room *room, uint64_t held)
{
    if (room)
        room->held = held;
}

enum tetlod_status room_reserve(struct room *room, void **array, size_t *capacity, size_t needed, size_t most,
                                size_t element_size, struct tetlod_error *error)
{
    if (needed <= *capacity)
        return TETLOD_OK;
    size_t grown = array_growth(*capacity, needed);
    if (grown > most)
        grown = needed > most ? needed : most;
    TETLOD_TRY(room_take(room, (uint64_t)grown * element_size, error));
    void *moved = array_resize(*array, grown, element_size);
    if (!moved)
        return tetlodi_fail_nomem(error, "an array that grows", (uint64_t)grown * element_size);
    room_back_to(room, room_held(room) - (uint64_t)*capacity * element_size);
    *array = moved;
    *capacity = grown;
    return TETLOD_OK;
}
