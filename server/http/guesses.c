/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/guesses.h"

#include <pthread.h>
#include <stdlib.h>

#include "server/http/quota.h"
#include "src/util/array.h"

struct guesses {
    pthread_mutex_t lock;
    struct quota waiting;
    struct guess *first, **end; /* all wait equally long: the first is the next */
};

struct guesses *guesses_new(void)
{
    struct guesses *guesses = array_zero(1, sizeof *guesses);
    if (!guesses)
        return NULL;
    pthread_mutex_init(&guesses->lock, NULL);
    guesses->end = &guesses->first;
    return guesses;
}

void guesses_free(struct guesses *guesses)
{
    if (guesses)
        pthread_mutex_destroy(&guesses->lock);
    free(guesses);
}

bool guesses_admit(struct guesses *guesses, const char *client)
{
    return quota_has_room(&guesses->waiting, client, MAX_GUESSES);
}

void guesses_add(struct guesses *guesses, struct guess *guess, const char *client, struct waiter *waiter, double now)
{
    *guess = (struct guess){waiter, now + GUESS_SECONDS, quota_place(client), NULL};
    quota_take(&guesses->waiting, guess->place);
    pthread_mutex_lock(&guesses->lock);
    *guesses->end = guess;
    guesses->end = &guess->next;
    pthread_mutex_unlock(&guesses->lock);
}

void guesses_wake(struct guesses *guesses, double now)
{
    struct waiter *due = NULL;
    pthread_mutex_lock(&guesses->lock);
    while (guesses->first && guesses->first->due <= now) {
        struct guess *guess = guesses->first;
        guesses->first = guess->next;
        quota_give(&guesses->waiting, guess->place);
        guess->waiter->next = due;
        due = guess->waiter;
    }
    if (!guesses->first)
        guesses->end = &guesses->first;
    pthread_mutex_unlock(&guesses->lock);
    wake_all(due);
}
