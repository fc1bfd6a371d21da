/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The simplices that wait for a higher limit or for a change around them, in little room: there is one for almost every simplex. They lie one
 * behind the other, as large as each is; a place is where one begins.
 */
#ifndef TETLOD_WAITING_LIST_H
#define TETLOD_WAITING_LIST_H

#include "src/simplify/queue.h"
#include "src/simplify/renumber.h"

struct waiting_simplex {
    double value;         /* a lower bound of its error */
    uint32_t vertices[2]; /* the first two; TETLOD_NONE: it has been taken out */
    uint32_t stamp;
    uint8_t extra;        /* vertices beyond two */
    uint8_t witnesses;    /* more than QUEUE_WITNESSES: not known, none are kept */
    uint8_t room;         /* numbers that `more` has room for: even, so that the next one is aligned */
    uint32_t more[];      /* further vertices, then witnesses */
};

struct waiting_list {
    char *simplices;
    size_t size, capacity, swept; /* bytes; when the list was last swept it had so many */
};

void waiting_list_fini(struct waiting_list *list);

/* Adds at the end what a queue's entry has while it waits: all but its bound and its candidates. False: no memory. */
bool waiting_list_add(struct waiting_list *list, const struct queue_entry *entry);

/* Puts another simplex in the place of one, or at the end where it needs more room. False: no memory. */
bool waiting_list_replace(struct waiting_list *list, size_t place, const struct queue_entry *entry);

/* The one at a place, until the next that is added. */
static inline struct waiting_simplex *waiting_list_at(const struct waiting_list *list, size_t place)
{
    return (struct waiting_simplex *)(void *)(list->simplices + place);
}

/* The place behind it: the first is 0, and behind the last is list->size. */
static inline size_t waiting_list_next(const struct waiting_list *list, size_t place)
{
    return place + sizeof(struct waiting_simplex) + waiting_list_at(list, place)->room * sizeof(uint32_t);
}

/* A simplex as a queue's entry. */
struct queue_entry waiting_list_get(const struct waiting_list *list, size_t place);

/* Takes a simplex out. The others keep their places until the list is swept. */
void waiting_list_take(struct waiting_list *list, size_t place);

/* Closes the gaps, and gives back room: what is left is for a sixteenth more. */
void waiting_list_sweep(struct waiting_list *list);

/* Have so many joined since that it should be swept? */
bool waiting_list_has_grown(const struct waiting_list *list);

/* Takes over new numbers of tetrahedra and of slots, all of which are left. A witness that is gone becomes TETLOD_NONE. */
void waiting_list_renumber(struct waiting_list *list, const struct renumbering *tets, const struct renumbering *slots);

#endif
