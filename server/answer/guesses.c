/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/answer/guesses.h"

#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>

#include "src/util/array.h"

enum { BUCKETS = 256 };

struct guesses {
    pthread_mutex_t lock;
    unsigned waiting[BUCKETS];    /* by client */
    struct guess *first, **end;   /* all wait equally long: the first is the next */
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

static size_t bucket_of(const char *client)
{
    uint32_t hash = 2166136261u; // FNV-1a
    for (; *client; client++)
        hash = (hash ^ (unsigned char)*client) * 16777619u;
    return (hash ^ hash >> 16) % BUCKETS;
}

bool guesses_admit(struct guesses *guesses, const char *client)
{
    pthread_mutex_lock(&guesses->lock);
    bool admitted = guesses->waiting[bucket_of(client)] < MAX_GUESSES;
    pthread_mutex_unlock(&guesses->lock);
    return admitted;
}

void guesses_add(struct guesses *guesses, struct guess *guess, const char *client, struct waiter *waiter, double now)
{
    *guess = (struct guess){waiter, now + GUESS_SECONDS, bucket_of(client), NULL};
    pthread_mutex_lock(&guesses->lock);
    guesses->waiting[guess->bucket]++;
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
        guesses->waiting[guess->bucket]--;
        guess->waiter->next = due;
        due = guess->waiter;
    }
    if (!guesses->first)
        guesses->end = &guesses->first;
    pthread_mutex_unlock(&guesses->lock);
    wake_all(due);
}
