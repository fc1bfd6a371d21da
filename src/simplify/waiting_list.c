/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/waiting_list.h"

#include <stdlib.h>
#include <string.h>

#include "format/tetlod.h"
#include "src/util/array.h"

void waiting_list_fini(struct waiting_list *list)
{
    free(list->simplices);
    *list = (struct waiting_list){0};
}

static uint32_t stored_witnesses(uint32_t count)
{
    return count <= QUEUE_WITNESSES ? count : 0;
}

static uint32_t extra_vertices(const struct queue_entry *entry)
{
    return (uint32_t)(entry->vertices[2] != TETLOD_NONE) + (entry->vertices[3] != TETLOD_NONE);
}

/* Room for so many numbers. */
static uint8_t even(uint32_t numbers)
{
    return (uint8_t)(numbers + numbers % 2);
}

static void write_simplex(struct waiting_simplex *simplex, const struct queue_entry *entry)
{
    simplex->value = entry->value;
    memcpy(simplex->vertices, entry->vertices, sizeof simplex->vertices);
    simplex->stamp = entry->stamp;
    simplex->extra = (uint8_t)extra_vertices(entry);
    simplex->witnesses = entry->witness_count;
    memcpy(simplex->more, entry->vertices + 2, simplex->extra * sizeof *simplex->more);
    memcpy(simplex->more + simplex->extra, entry->witness, stored_witnesses(entry->witness_count) * sizeof *simplex->more);
}

bool waiting_list_add(struct waiting_list *list, const struct queue_entry *entry)
{
    void *grown = list->simplices;
    uint8_t room = even(extra_vertices(entry) + stored_witnesses(entry->witness_count));
    size_t size = sizeof(struct waiting_simplex) + room * sizeof(uint32_t), place = list->size;
    if (!array_reserve(&grown, &list->capacity, list->size + size, 1))
        return false;
    list->simplices = grown;
    list->size += size;
    waiting_list_at(list, place)->room = room;
    write_simplex(waiting_list_at(list, place), entry);
    return true;
}

bool waiting_list_replace(struct waiting_list *list, size_t place, const struct queue_entry *entry)
{
    if (extra_vertices(entry) + stored_witnesses(entry->witness_count) > waiting_list_at(list, place)->room) {
        waiting_list_take(list, place);
        return waiting_list_add(list, entry);
    }
    write_simplex(waiting_list_at(list, place), entry);
    return true;
}

struct queue_entry waiting_list_get(const struct waiting_list *list, size_t place)
{
    const struct waiting_simplex *simplex = waiting_list_at(list, place);
    struct queue_entry entry = {.value = simplex->value,
                                .vertices = {simplex->vertices[0], simplex->vertices[1], TETLOD_NONE, TETLOD_NONE},
                                .stamp = simplex->stamp,
                                .witness_count = simplex->witnesses & 31};
    memcpy(entry.vertices + 2, simplex->more, simplex->extra * sizeof *simplex->more);
    memcpy(entry.witness, simplex->more + simplex->extra, stored_witnesses(simplex->witnesses) * sizeof *simplex->more);
    return entry;
}

void waiting_list_take(struct waiting_list *list, size_t place)
{
    waiting_list_at(list, place)->vertices[0] = TETLOD_NONE;
}

void waiting_list_sweep(struct waiting_list *list)
{
    size_t kept = 0;
    for (size_t at = 0, next; at < list->size; at = next) {
        struct waiting_simplex *simplex = waiting_list_at(list, at);
        next = waiting_list_next(list, at);
        if (simplex->vertices[0] == TETLOD_NONE)
            continue;
        simplex->room = even(simplex->extra + stored_witnesses(simplex->witnesses));
        size_t size = waiting_list_next(list, at) - at;
        memmove(list->simplices + kept, simplex, size);
        kept += size;
    }
    list->size = list->swept = kept;
    size_t fitting = kept + kept / 16 + 1024;
    if (list->capacity <= fitting + kept / 16)
        return;
    list->simplices = array_shrink(list->simplices, fitting, 1);
    list->capacity = fitting;
}

bool waiting_list_has_grown(const struct waiting_list *list)
{
    return list->size > list->swept + list->swept / 16 + 1024 * sizeof(struct waiting_simplex);
}

void waiting_list_renumber(struct waiting_list *list, const struct renumbering *tets, const struct renumbering *slots)
{
    for (size_t at = 0; at < list->size; at = waiting_list_next(list, at)) {
        struct waiting_simplex *simplex = waiting_list_at(list, at);
        for (int k = 0; k < 2; k++)
            simplex->vertices[k] = renumbered(slots, simplex->vertices[k]);
        for (uint32_t k = 0; k < simplex->extra; k++)
            simplex->more[k] = renumbered(slots, simplex->more[k]);
        for (uint32_t k = simplex->extra; k < simplex->extra + stored_witnesses(simplex->witnesses); k++)
            simplex->more[k] = renumbered(tets, simplex->more[k]);
    }
}
