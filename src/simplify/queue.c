/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/queue.h"

#include <stdlib.h>

#include "src/util/array.h"

void queue_fini(struct queue *queue)
{
    free(queue->entries);
    *queue = (struct queue){0};
}

static bool before(const struct queue_entry *x, const struct queue_entry *y)
{
    if (x->value != y->value)
        return x->value < y->value;
    for (int i = 0; i < 4; i++)
        if (x->vertices[i] != y->vertices[i])
            return x->vertices[i] < y->vertices[i];
    return false;
}

bool queue_append(struct queue *queue, const struct queue_entry *entry)
{
    void *grown = queue->entries;
    if (!array_reserve(&grown, &queue->capacity, queue->count + 1, sizeof *entry))
        return false;
    queue->entries = grown;
    queue->entries[queue->count++] = *entry;
    return true;
}

bool queue_push(struct queue *queue, const struct queue_entry *entry)
{
    if (!queue_append(queue, entry))
        return false;
    struct queue_entry *entries = queue->entries, moving = *entry;
    size_t i = queue->count - 1;
    for (; i > 0 && before(&moving, &entries[(i - 1) / 2]); i = (i - 1) / 2)
        entries[i] = entries[(i - 1) / 2];
    entries[i] = moving;
    return true;
}

struct queue_entry queue_pop(struct queue *queue)
{
    struct queue_entry *entries = queue->entries, top = entries[0], moving = entries[--queue->count];
    size_t i = 0, child;
    while ((child = 2 * i + 1) < queue->count) {
        if (child + 1 < queue->count && before(&entries[child + 1], &entries[child]))
            child++;
        if (!before(&entries[child], &moving))
            break;
        entries[i] = entries[child];
        i = child;
    }
    if (queue->count)
        entries[i] = moving;
    return top;
}

/* The entry by its new numbers. False: a vertex is gone. */
static bool renumber_entry(struct queue_entry *entry, const struct renumbering *tets, const struct renumbering *slots)
{
    for (int i = 0; i < 4 && entry->vertices[i] != TETLOD_NONE; i++) {
        entry->vertices[i] = renumbered(slots, entry->vertices[i]);
        if (entry->vertices[i] == TETLOD_NONE)
            return false;
    }
    for (uint32_t i = 0; i < entry->witness_count && i < QUEUE_WITNESSES; i++)
        entry->witness[i] = renumbered(tets, entry->witness[i]);
    return true;
}

void queue_renumber(struct queue *queue, const struct renumbering *tets, const struct renumbering *slots)
{
    size_t count = queue->count;
    queue->count = 0;
    for (size_t i = 0; i < count; i++) {
        struct queue_entry entry = queue->entries[i];
        if (renumber_entry(&entry, tets, slots))
            queue_push(queue, &entry); // there is room: no more have been kept than were read
    }
}

bool queue_check(const struct queue *queue)
{
    for (size_t i = 1; i < queue->count; i++)
        if (before(&queue->entries[i], &queue->entries[(i - 1) / 2]))
            return false;
    return true;
}
