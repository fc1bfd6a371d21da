/* SPDX-License-Identifier: BSD-3-Clause */
/* A binary heap of simplices by key, ties by their vertices. */
#ifndef TETLOD_QUEUE_H
#define TETLOD_QUEUE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "src/simplify/renumber.h"

enum { QUEUE_WITNESSES = 8, QUEUE_CANDIDATES = 22 };

struct queue_entry {
    double value;             /* the key in a queue, a lower bound of the error while it waits */
    double bound;             /* the least that the refused candidates need */
    uint32_t vertices[4];     /* ascending; TETLOD_NONE behind the last */
    uint32_t stamp;           /* contractions done when it was evaluated */
    uint32_t refused : QUEUE_CANDIDATES; /* bits of the candidates that the exact limit has refused since */
    uint32_t candidate : 5;
    uint32_t witness_count : 5; /* waiting: while these tetrahedra are as they were, so is the bound; none: not known */
    uint32_t witness[QUEUE_WITNESSES]; /* TETLOD_NONE: it is gone */
};

struct queue {
    struct queue_entry *entries;
    size_t count, capacity;
};

void queue_fini(struct queue *queue);

/* Plain append, without keeping the heap's order: for plain lists. False: out of memory. */
bool queue_append(struct queue *queue, const struct queue_entry *entry);

bool queue_push(struct queue *queue, const struct queue_entry *entry);
struct queue_entry queue_pop(struct queue *queue); /* count > 0 */

/* Takes over new numbers of tetrahedra and of slots, and drops what has a vertex that is gone. A witness that is gone becomes TETLOD_NONE. */
void queue_renumber(struct queue *queue, const struct renumbering *tets, const struct renumbering *slots);

/* Every entry is no smaller than its parent. */
bool queue_check(const struct queue *queue);

#endif
