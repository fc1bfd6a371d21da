/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A wrong token costs time. Its answer waits for GUESS_SECONDS, without a thread but with its connection, and a client
 * has MAX_GUESSES such answers waiting: further tokens of that client are not looked at meanwhile, right or wrong. So a
 * client tries at most MAX_GUESSES tokens a GUESS_SECONDS, however many connections it has. Any thread may call.
 */
#ifndef TETLOD_SERVER_GUESSES_H
#define TETLOD_SERVER_GUESSES_H

#include <stdbool.h>
#include <stddef.h>

#include "server/store/waiter.h"

#define GUESS_SECONDS 1.0

enum { MAX_GUESSES = 8 };

struct guesses;

/* An answer that waits: part of its request. */
struct guess {
    struct waiter *waiter;
    double due;
    size_t place; /* of its client */
    struct guess *next;
};

/* NULL if memory is out. Freed when no answer waits. */
struct guesses *guesses_new(void);
void guesses_free(struct guesses *guesses);

/* False: this client has as many wrong tokens waiting as it may. */
bool guesses_admit(struct guesses *guesses, const char *client);

/* Registers an answer: its waiter is woken when it is time. */
void guesses_add(struct guesses *guesses, struct guess *guess, const char *client, struct waiter *waiter, double now);

/* Wakes those whose time has come. */
void guesses_wake(struct guesses *guesses, double now);

#endif
