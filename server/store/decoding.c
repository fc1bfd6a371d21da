/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/decoding.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "format/fail.h"
#include "src/util/array.h"

struct decoding {
    struct tetlod_file *file; /* borrowed */
    _Atomic(struct forest *) forest; /* NULL until the first run */
    pthread_mutex_t lock;
    bool running;
    struct tetlod_error failure; /* of the last run */
    struct waiter *waiters;
};

struct decoding *decoding_new(struct tetlod_file *file)
{
    struct decoding *decoding = array_zero(1, sizeof *decoding);
    if (!decoding)
        return NULL;
    decoding->file = file;
    if (pthread_mutex_init(&decoding->lock, NULL) == 0)
        return decoding;
    free(decoding);
    return NULL;
}

void decoding_free(struct decoding *decoding)
{
    if (!decoding)
        return;
    forest_free(atomic_load(&decoding->forest));
    pthread_mutex_destroy(&decoding->lock);
    free(decoding);
}

uint64_t decoding_bytes(const struct decoding *decoding)
{
    const struct forest *forest = atomic_load_explicit(&decoding->forest, memory_order_acquire);
    return forest ? forest_bytes(forest) : 0;
}

const struct forest *decoding_find(const struct decoding *decoding, uint32_t level)
{
    const struct forest *forest = atomic_load_explicit(&decoding->forest, memory_order_acquire);
    return forest && level < forest_levels(forest) ? forest : NULL;
}

enum decoding_state decoding_ask(struct decoding *decoding, uint32_t level, bool waited, struct waiter *waiter,
                                 struct tetlod_error *failure)
{
    enum decoding_state state = DECODING_COMING;
    pthread_mutex_lock(&decoding->lock);
    if (decoding_find(decoding, level))
        state = DECODING_READY;
    else if (!decoding->running && waited && decoding->failure.status) {
        state = DECODING_FAILED;
        *failure = decoding->failure;
    } else {
        state = decoding->running ? DECODING_COMING : DECODING_MINE;
        decoding->running = true;
        if (waiter) {
            waiter->next = decoding->waiters;
            decoding->waiters = waiter;
        }
    }
    pthread_mutex_unlock(&decoding->lock);
    return state;
}

static void wake_waiters(struct decoding *decoding, bool running)
{
    pthread_mutex_lock(&decoding->lock);
    struct waiter *waiters = decoding->waiters;
    decoding->waiters = NULL;
    decoding->running = running;
    pthread_mutex_unlock(&decoding->lock);
    wake_all(waiters);
}

void decoding_cancel(struct decoding *decoding, const struct tetlod_error *why)
{
    decoding->failure = *why; // read by others only once nothing runs
    wake_waiters(decoding, false);
}

enum tetlod_status decoding_run(struct decoding *decoding, uint32_t level, bool (*stopping)(void *opaque), void *opaque,
                                struct tetlod_error *error)
{
    enum tetlod_status status = TETLOD_OK;
    struct tetlod_error failure = {0};
    struct forest *forest = atomic_load(&decoding->forest);
    if (!forest) {
        status = forest_new(&forest, decoding->file, &failure);
        atomic_store(&decoding->forest, forest);
    }
    while (status == TETLOD_OK && forest_levels(forest) <= level) {
        uint32_t levels = forest_levels(forest);
        status = stopping && stopping(opaque) ? tetlodi_fail(&failure, TETLOD_ERR_LIMIT, "the server is stopping")
                                              : forest_grow(forest, &failure);
        if (forest_levels(forest) > levels)
            wake_waiters(decoding, true);
    }
    failure.status = status;
    decoding_cancel(decoding, &failure);
    if (error)
        *error = failure;
    return status;
}
