/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/waiting_list.h"

#include <stdlib.h>
#include <string.h>

#include "format/tetlod.h"
#include "src/util/array.h"

/* Instead of a record: an edge without witnesses; one with too many. */
static const uint32_t BARE = UINT32_MAX, UNKNOWN = UINT32_MAX - 1;

/* A record begins with the number of its simplex, and with how many vertices and, these bits higher, witnesses follow. */
enum { OWNER, COUNTS, HEAD, WITNESS_BITS = 8 };

void waiting_list_fini(struct waiting_list *list)
{
    free(list->simplices);
    free(list->pool);
    *list = (struct waiting_list){0};
}

static bool has_record(const struct waiting_simplex *simplex)
{
    return simplex->record < UNKNOWN;
}

static uint32_t stored_witnesses(uint32_t count)
{
    return count <= QUEUE_WITNESSES ? count : 0;
}

static uint32_t extra_vertices(const uint32_t *record)
{
    return record[COUNTS] & ((1u << WITNESS_BITS) - 1);
}

static uint32_t witness_count(const uint32_t *record)
{
    return record[COUNTS] >> WITNESS_BITS;
}

static size_t record_size(const uint32_t *record)
{
    return HEAD + (size_t)extra_vertices(record) + stored_witnesses(witness_count(record));
}

/* Moves the records that are in use to the front of the pool. */
static void compact_pool(struct waiting_list *list)
{
    size_t kept = 0;
    for (size_t at = 0, size; at < list->pool_size; at += size) {
        uint32_t *record = list->pool + at;
        size = record_size(record);
        if (record[OWNER] >= list->count || list->simplices[record[OWNER]].record != at)
            continue;
        list->simplices[record[OWNER]].record = (uint32_t)kept;
        memmove(list->pool + kept, record, size * sizeof *record);
        kept += size;
    }
    list->pool_size = kept;
}

/* Gives an array room for `count` and a sixteenth more, if it has much more than that. What cannot be had is left as it is. */
static void fit(void **array, size_t *capacity, size_t count, size_t size)
{
    size_t fitting = count + count / 16 + 16;
    void *fitted = *capacity > fitting + count / 16 ? array_resize(*array, fitting, size) : NULL;
    if (!fitted)
        return;
    *array = fitted;
    *capacity = fitting;
}

/* Room for so many more numbers in the pool. */
static bool pool_room(struct waiting_list *list, size_t needed)
{
    void *pool = list->pool;
    if (list->pool_size + needed <= list->pool_capacity)
        return true;
    compact_pool(list);
    size_t wanted = list->pool_size + needed, capacity = wanted + list->pool_size / 8 + 1024;
    if (capacity >= UNKNOWN)
        return false;
    if (wanted + list->pool_size / 16 <= list->pool_capacity)
        return true;
    pool = array_resize(list->pool, capacity, sizeof *list->pool);
    if (!pool)
        return false;
    list->pool = pool;
    list->pool_capacity = capacity;
    return true;
}

/* The record of the simplex of that number. False: no memory. */
static bool add_record(struct waiting_list *list, const struct queue_entry *entry, size_t number, uint32_t *out)
{
    uint32_t extra = (entry->vertices[2] != TETLOD_NONE) + (entry->vertices[3] != TETLOD_NONE);
    uint32_t stored = stored_witnesses(entry->witness_count);
    if (!extra && !stored) {
        *out = entry->witness_count ? UNKNOWN : BARE;
        return true;
    }
    if (!pool_room(list, HEAD + (size_t)extra + stored))
        return false;
    uint32_t *record = list->pool + list->pool_size;
    record[OWNER] = (uint32_t)number;
    record[COUNTS] = extra | (uint32_t)entry->witness_count << WITNESS_BITS;
    memcpy(record + HEAD, entry->vertices + 2, extra * sizeof *record);
    memcpy(record + HEAD + extra, entry->witness, stored * sizeof *record);
    *out = (uint32_t)list->pool_size;
    list->pool_size += record_size(record);
    return true;
}

bool waiting_list_add(struct waiting_list *list, const struct queue_entry *entry)
{
    void *grown = list->simplices;
    if (!array_reserve(&grown, &list->capacity, list->count + 1, sizeof *list->simplices))
        return false;
    list->simplices = grown;
    list->simplices[list->count].record = BARE;
    return waiting_list_replace(list, list->count++, entry);
}

bool waiting_list_replace(struct waiting_list *list, size_t number, const struct queue_entry *entry)
{
    uint32_t record;
    list->simplices[number].record = BARE;
    if (!add_record(list, entry, number, &record))
        return false;
    list->simplices[number] = (struct waiting_simplex){
        .value = entry->value, .vertices = {entry->vertices[0], entry->vertices[1]}, .stamp = entry->stamp, .record = record};
    return true;
}

struct queue_entry waiting_list_get(const struct waiting_list *list, size_t number)
{
    const struct waiting_simplex *simplex = &list->simplices[number];
    struct queue_entry entry = {.value = simplex->value,
                                .vertices = {simplex->vertices[0], simplex->vertices[1], TETLOD_NONE, TETLOD_NONE},
                                .stamp = simplex->stamp,
                                .witness_count = simplex->record == UNKNOWN ? QUEUE_WITNESSES + 1 : 0};
    if (!has_record(simplex))
        return entry;
    const uint32_t *record = list->pool + simplex->record;
    uint32_t extra = extra_vertices(record), witnesses = witness_count(record);
    entry.witness_count = witnesses & 31;
    memcpy(entry.vertices + 2, record + HEAD, extra * sizeof *record);
    memcpy(entry.witness, record + HEAD + extra, stored_witnesses(witnesses) * sizeof *record);
    return entry;
}

void waiting_list_take(struct waiting_list *list, size_t number)
{
    list->simplices[number].vertices[0] = TETLOD_NONE;
    list->simplices[number].record = BARE;
}

void waiting_list_sweep(struct waiting_list *list)
{
    size_t kept = 0;
    for (size_t i = 0; i < list->count; i++) {
        if (list->simplices[i].vertices[0] == TETLOD_NONE)
            continue;
        list->simplices[kept] = list->simplices[i];
        if (has_record(&list->simplices[kept]))
            list->pool[list->simplices[kept].record + OWNER] = (uint32_t)kept;
        kept++;
    }
    list->count = list->swept = kept;
    compact_pool(list);
    void *simplices = list->simplices, *pool = list->pool;
    fit(&simplices, &list->capacity, list->count, sizeof *list->simplices);
    fit(&pool, &list->pool_capacity, list->pool_size, sizeof *list->pool);
    list->simplices = simplices;
    list->pool = pool;
}

void waiting_list_renumber(struct waiting_list *list, const struct renumbering *tets, const struct renumbering *slots)
{
    for (size_t i = 0; i < list->count; i++) {
        struct waiting_simplex *simplex = &list->simplices[i];
        uint32_t *record = list->pool + simplex->record;
        for (int k = 0; k < 2; k++)
            simplex->vertices[k] = slots->numbers[simplex->vertices[k]];
        if (!has_record(simplex))
            continue;
        uint32_t extra = extra_vertices(record);
        for (uint32_t k = 0; k < extra; k++)
            record[HEAD + k] = slots->numbers[record[HEAD + k]];
        for (uint32_t k = HEAD + extra; k < record_size(record); k++)
            record[k] = renumbered(tets, record[k]);
    }
}
