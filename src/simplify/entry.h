/* SPDX-License-Identifier: BSD-3-Clause */
/* A queue's entry and the complex: what has changed since it was evaluated. */
#ifndef TETLOD_ENTRY_H
#define TETLOD_ENTRY_H

#include "src/simplify/complex.h"
#include "src/simplify/queue.h"

/* A simplex waits for all its candidates' witnesses; too many make the whole unknown. A candidate that the boundary forbids
 * has none: it stays forbidden. */
static inline void remember_witnesses(struct queue_entry *entry, const uint32_t witness[2])
{
    if (witness[0] == TETLOD_NONE)
        return;
    if (entry->witness_count + 2 > QUEUE_WITNESSES) {
        entry->witness_count = QUEUE_WITNESSES + 1;
        return;
    }
    entry->witness[entry->witness_count++] = witness[0];
    entry->witness[entry->witness_count++] = witness[1];
}

static inline uint32_t vertex_count(const struct queue_entry *entry)
{
    uint32_t count = 2;
    while (count < 4 && entry->vertices[count] != TETLOD_NONE)
        count++;
    return count;
}

/* An entry is obsolete when a vertex is gone or was made anew since (its simplices were filed again then). */
static inline bool obsolete(const struct complex *complex, const struct queue_entry *entry)
{
    for (uint32_t i = 0; i < 4 && entry->vertices[i] != TETLOD_NONE; i++)
        if (!complex_alive(complex, entry->vertices[i]) || complex->born[entry->vertices[i]] > entry->stamp)
            return true;
    return false;
}

static inline bool stale(const struct complex *complex, const struct queue_entry *entry)
{
    for (uint32_t i = 0; i < 4 && entry->vertices[i] != TETLOD_NONE; i++)
        if (complex->changed[entry->vertices[i]] > entry->stamp)
            return true;
    return false;
}

/* Could what kept an entry waiting have changed? */
static inline bool may_have_eased(const struct complex *complex, const struct queue_entry *entry)
{
    if (!stale(complex, entry))
        return false;
    bool eased = entry->witness_count > QUEUE_WITNESSES;
    for (uint32_t i = 0; i < entry->witness_count && !eased; i++)
        eased = entry->witness[i] == TETLOD_NONE || complex->tet_changed[entry->witness[i]] > entry->stamp;
    return eased;
}

#endif
