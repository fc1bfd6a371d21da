/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The simplices that wait for a higher limit or for a change around them, in little room: there is one for almost every simplex. Most are
 * edges without witnesses. The others have their numbers in a pool.
 */
#ifndef TETLOD_WAITING_LIST_H
#define TETLOD_WAITING_LIST_H

#include "src/simplify/queue.h"
#include "src/simplify/renumber.h"

struct waiting_simplex {
    double value;         /* a lower bound of its error */
    uint32_t vertices[2]; /* the first two; TETLOD_NONE: it has been taken out */
    uint32_t stamp;
    uint32_t record;      /* where it begins in the pool */
};

struct waiting_list {
    struct waiting_simplex *simplices;
    size_t count, capacity, swept; /* there were so many when the list was last swept */
    uint32_t *pool; /* records: number of the simplex, how many vertices beyond two and witnesses it has, and these */
    size_t pool_size, pool_capacity;
};

void waiting_list_fini(struct waiting_list *list);

/* Adds what a queue's entry has while it waits: all but its bound and its candidates. False: no memory. */
bool waiting_list_add(struct waiting_list *list, const struct queue_entry *entry);

/* Puts another simplex in the place of one. False: no memory. */
bool waiting_list_replace(struct waiting_list *list, size_t number, const struct queue_entry *entry);

/* A simplex as a queue's entry. */
struct queue_entry waiting_list_get(const struct waiting_list *list, size_t number);

/* Takes a simplex out. The others keep their numbers until the list is swept. */
void waiting_list_take(struct waiting_list *list, size_t number);

/* Closes the gaps, and gives back room: what is left is for a sixteenth more. */
void waiting_list_sweep(struct waiting_list *list);

/* Takes over new numbers of tetrahedra and of slots, all of which are left. A witness that is gone becomes TETLOD_NONE. */
void waiting_list_renumber(struct waiting_list *list, const struct renumbering *tets, const struct renumbering *slots);

#endif
