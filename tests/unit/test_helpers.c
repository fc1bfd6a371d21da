/* SPDX-License-Identifier: BSD-3-Clause */
/* Threads that help: tasks that are committed in order, and threads that have little to do and do not look for it. */
#include <stdatomic.h>
#include <stdint.h>
#include <time.h>

#include "format/common/threads.h"
#include "src/util/parallel.h"
#include "tests/test.h"

enum { TASKS = 300, HELPERS = 3 };

struct ordered {
    atomic_uint begun, ahead;
    atomic_uchar done[TASKS];
    uint32_t committed, wrong, last; /* last: whose commit fails */
};

static int do_task(void *opaque, uint32_t number)
{
    struct ordered *all = opaque;
    uint32_t ahead = number - atomic_load(&all->begun), most = atomic_load(&all->ahead);
    while (ahead < TASKS && ahead > most && !atomic_compare_exchange_weak(&all->ahead, &most, ahead))
        continue;
    atomic_store(&all->done[number], 1);
    return 1;
}

static int commit(void *opaque, uint32_t number)
{
    struct ordered *all = opaque;
    all->wrong += number != all->committed || !atomic_load(&all->done[number]);
    all->committed++;
    atomic_store(&all->begun, all->committed);
    return number != all->last;
}

/* By no, one and several helpers: each behind its task, in order, with few tasks ahead; one that fails is the last. */
static void test_in_order(void)
{
    for (uint32_t count = 0; count <= HELPERS; count++)
        for (uint32_t last = TASKS / 2; last <= TASKS; last += TASKS / 2) {
            struct tetlodi_helpers *helpers = tetlodi_helpers_new(count);
            struct ordered all = {.last = last};
            int good = tetlodi_helpers_in_order(helpers, do_task, commit, &all, TASKS);
            CHECK_INT(good, last == TASKS);
            CHECK_INT(all.wrong, 0);
            CHECK_INT(all.committed, last == TASKS ? TASKS : last + 1);
            CHECK(atomic_load(&all.ahead) <= 2 * (count + 1));
            tetlodi_helpers_start(helpers, do_task, &all, TASKS); // these go on as ever
            tetlodi_helpers_wait(helpers);
            tetlodi_helpers_free(helpers);
        }
}

static int do_late(void *opaque, uint32_t number)
{
    atomic_store((atomic_uint *)opaque, number + 1);
    return nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL) == 0; // most likely it is dismissed meanwhile
}

/* A helper that is dismissed while it has a task ends with this task. */
static void test_dismissed_at_work(void)
{
    atomic_uint begun = 0;
    struct tetlodi_helpers *helpers = tetlodi_helpers_new(1);
    REQUIRE(helpers);
    tetlodi_helpers_start(helpers, do_late, &begun, TASKS);
    while (!atomic_load(&begun))
        continue;
    tetlodi_helpers_free(helpers);
    CHECK(atomic_load(&begun) < TASKS);
}

static double seconds_of(clockid_t clock)
{
    struct timespec time;
    clock_gettime(clock, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static void do_nothing(void *context, unsigned worker, size_t begin, size_t end)
{
    (void)context, (void)worker, (void)begin, (void)end;
}

/* A caller that works for a tenth of a millisecond between jobs of no work: its threads sleep meanwhile. */
static void test_idle(void)
{
    enum { JOBS = 2000 };
    struct pool *pool = pool_new(2);
    REQUIRE(pool);
    double begun = seconds_of(CLOCK_PROCESS_CPUTIME_ID), own = seconds_of(CLOCK_THREAD_CPUTIME_ID);
    for (int job = 0; job < JOBS; job++) {
        double until = seconds_of(CLOCK_THREAD_CPUTIME_ID) + 1e-4;
        while (seconds_of(CLOCK_THREAD_CPUTIME_ID) < until)
            continue;
        pool_run(pool, 2, 1, do_nothing, NULL);
    }
    own = seconds_of(CLOCK_THREAD_CPUTIME_ID) - own;
    double others = seconds_of(CLOCK_PROCESS_CPUTIME_ID) - begun - own;
    pool_free(pool);
    if (others > 0.5 * own)
        TEST_FAIL("the other thread took %.2f of the caller's time", others / own);
}

/* What the threads of a pool did. */
struct turns {
    double own; /* seconds that the caller works on its part */
    atomic_int others;
};

static void take_turn(void *context, unsigned worker, size_t begin, size_t end)
{
    struct turns *turns = context;
    double until = seconds_of(CLOCK_THREAD_CPUTIME_ID) + turns->own * (double)(end - begin);
    while (!worker && seconds_of(CLOCK_THREAD_CPUTIME_ID) < until)
        continue;
    if (worker) {
        atomic_fetch_add(&turns->others, 1);
        nanosleep(&(struct timespec){.tv_nsec = 4000000}, NULL); // as if others had taken the processor away
    }
}

/* A thread that is slower than the caller is not waited for at each job. */
static void test_held_up(void)
{
    enum { JOBS = 400 };
    struct turns turns = {.own = 1e-4};
    struct pool *pool = pool_new(2);
    REQUIRE(pool);
    for (int job = 0; job < JOBS; job++)
        pool_run(pool, 2, 1, take_turn, &turns);
    pool_free(pool);
    if (turns.others > JOBS / 10)
        TEST_FAIL("it was waited for at %d of %d jobs", turns.others, JOBS);
}

int main(void)
{
    RUN(test_in_order);
    RUN(test_dismissed_at_work);
    RUN(test_idle);
    RUN(test_held_up);
    return test_end();
}
