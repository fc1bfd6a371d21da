/* SPDX-License-Identifier: BSD-3-Clause */
/* Threads that help the caller's. Not installed. */
#ifndef TETLOD_THREADS_H
#define TETLOD_THREADS_H

#include <stdint.h>

/* Are there ever any? */
#if (defined(__unix__) || defined(__APPLE__)) && !defined(__wasm__)
#define TETLODI_THREADS 1
#else
#define TETLODI_THREADS 0
#endif

struct tetlodi_helpers;

/* So many threads beside the caller's, fewer if some cannot be started; NULL if none can: everything works without. */
struct tetlodi_helpers *tetlodi_helpers_new(uint32_t count);
void tetlodi_helpers_free(struct tetlodi_helpers *helpers);

/* What threads do: 0 if it failed. Then no further task is begun; all of lower numbers have been. */
typedef int tetlodi_task(void *context, uint32_t number);

/* Begins task(context, 0 ... count - 1), one after the other. The tasks before have ended: the caller has waited.
 * Without helpers everything is done at once. */
void tetlodi_helpers_start(struct tetlodi_helpers *helpers, tetlodi_task *task, void *context, uint32_t count);

/* Until all tasks have ended. The caller takes part. */
void tetlodi_helpers_wait(struct tetlodi_helpers *helpers);

/* Many things are shared out by so many to a task, which are whole words of bits. */
enum { TETLODI_A_TASK = 1 << 14 };

static inline uint32_t tetlodi_task_begin(uint32_t task)
{
    return task * (uint32_t)TETLODI_A_TASK;
}

/* `things`: of all tasks. */
static inline uint32_t tetlodi_task_end(uint32_t task, uint32_t things)
{
    uint32_t begin = tetlodi_task_begin(task);
    return things - begin < TETLODI_A_TASK ? things : begin + TETLODI_A_TASK;
}

/* Does the tasks of so many things. */
static inline void tetlodi_helpers_share(struct tetlodi_helpers *helpers, tetlodi_task *task, void *context,
                                         uint32_t things)
{
    tetlodi_helpers_start(helpers, task, context, (things + TETLODI_A_TASK - 1) / TETLODI_A_TASK);
    tetlodi_helpers_wait(helpers);
}

/* Does task(context, 0 ... count - 1) and, in the order of numbers and on the caller's thread, commit(context, number)
 * behind each: few tasks are ever ahead of what is committed. A commit that fails, which that of a task that failed has
 * to, ends it: 0. */
int tetlodi_helpers_in_order(struct tetlodi_helpers *helpers, tetlodi_task *task, tetlodi_task *commit, void *context,
                             uint32_t count);

#endif
