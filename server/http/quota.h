/* SPDX-License-Identifier: BSD-3-Clause */
/* How many of something each client holds. Any thread may call. Clients share a place in the table now and then, and
 * then their limit. */
#ifndef TETLOD_SERVER_QUOTA_H
#define TETLOD_SERVER_QUOTA_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

enum { QUOTA_CLIENTS = 1024 };

struct quota {
    atomic_uint held[QUOTA_CLIENTS];
};

/* The client's place in the table. */
size_t quota_place(const char *client);

static inline bool quota_has_room(const struct quota *quota, const char *client, unsigned limit)
{
    return atomic_load(&quota->held[quota_place(client)]) < limit;
}

static inline void quota_take(struct quota *quota, size_t place)
{
    atomic_fetch_add(&quota->held[place], 1);
}

static inline void quota_give(struct quota *quota, size_t place)
{
    atomic_fetch_sub(&quota->held[place], 1);
}

#endif
