/* SPDX-License-Identifier: BSD-3-Clause */
/* Who waits for something that another thread makes. */
#ifndef TETLOD_SERVER_WAITER_H
#define TETLOD_SERVER_WAITER_H

#include <stddef.h>

/* Called once, from the maker's thread. Its storage is the caller's until then. */
struct waiter {
    void (*wake)(struct waiter *waiter);
    struct waiter *next;
};

/* Wakes a list. Called without locks: who is woken may ask again at once. */
static inline void wake_all(struct waiter *waiter)
{
    while (waiter) {
        struct waiter *next = waiter->next; // its storage is gone once it is woken
        waiter->wake(waiter);
        waiter = next;
    }
}

#endif
