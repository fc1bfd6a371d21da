/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/http/policy.h"

#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

/* A policy with its texts, counted. */
struct counted {
    struct access_policy policy; /* first: a holder has this address */
    size_t holders;              /* under the lock */
    char **texts;
    size_t text_count;
};

struct access {
    pthread_mutex_t lock;
    struct counted *current;
};

static const struct access_policy everybody;

static void counted_free(struct counted *counted)
{
    if (!counted)
        return;
    for (size_t i = 0; i < counted->text_count; i++)
        free(counted->texts[i]);
    free(counted->texts);
    free(counted);
}

static const char *copy_text(struct counted *out, const char *text)
{
    char *copy = strdup(text);
    if (copy)
        out->texts[out->text_count++] = copy;
    return copy;
}

/* Origins, hosts, and the token at the end: their copies lie in one array in this order. */
static struct counted *copy_policy(const struct access_policy *policy)
{
    size_t count = policy->origin_count + policy->host_count + (policy->token != NULL);
    struct counted *out = array_zero(1, sizeof *out);
    if (!out || !(out->texts = array_zero(count, sizeof *out->texts))) {
        free(out);
        return NULL;
    }
    for (size_t i = 0; i < policy->origin_count; i++)
        copy_text(out, policy->origins[i]);
    for (size_t i = 0; i < policy->host_count; i++)
        copy_text(out, policy->hosts[i]);
    if (policy->token)
        out->policy.token = copy_text(out, policy->token);
    if (out->text_count != count) {
        counted_free(out);
        return NULL;
    }
    out->policy.origins = (const char *const *)out->texts;
    out->policy.origin_count = policy->origin_count;
    out->policy.hosts = out->policy.origins + policy->origin_count;
    out->policy.host_count = policy->host_count;
    out->holders = 1;
    return out;
}

struct access *access_new(void)
{
    struct access *access = array_zero(1, sizeof *access);
    if (!access)
        return NULL;
    pthread_mutex_init(&access->lock, NULL);
    if (access_set(access, &everybody))
        return access;
    access_free(access);
    return NULL;
}

void access_free(struct access *access)
{
    if (!access)
        return;
    counted_free(access->current);
    pthread_mutex_destroy(&access->lock);
    free(access);
}

static void drop(struct access *access, struct counted *counted)
{
    pthread_mutex_lock(&access->lock);
    size_t left = counted ? --counted->holders : 1;
    pthread_mutex_unlock(&access->lock);
    if (!left)
        counted_free(counted);
}

int access_set(struct access *access, const struct access_policy *policy)
{
    struct counted *next = copy_policy(policy);
    if (!next)
        return 0;
    pthread_mutex_lock(&access->lock);
    struct counted *before = access->current;
    access->current = next;
    pthread_mutex_unlock(&access->lock);
    drop(access, before);
    return 1;
}

const struct access_policy *access_hold(struct access *access)
{
    if (!access)
        return &everybody;
    pthread_mutex_lock(&access->lock);
    struct counted *counted = access->current;
    counted->holders++;
    pthread_mutex_unlock(&access->lock);
    return &counted->policy;
}

void access_let_go(struct access *access, const struct access_policy *policy)
{
    if (access)
        drop(access, (struct counted *)(void *)(uintptr_t)policy);
}
