/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * 1. Every proposal claims its vertices, by the least priority.
 * 2. A proposal wins if no vertex around its own is claimed by a lesser one.
 * 3. A winner that depends on a star that has changed since it was evaluated is stale.
 */
#include "src/simplify/rounds/contest.h"

#include <stdlib.h>
#include <string.h>

#include "src/util/array.h"

/* Of the proposals one in PART is compared at a time, those with the least priorities, until they are one in REFILL;
 * fewer than FEW are not parted. */
enum { PART = 4, REFILL = 8, FEW = 512 };

enum listed { NOT_LISTED, LISTED_NOW, LISTED_LATER };

bool contest_init(struct contest *contest, const struct run *run)
{
    size_t n = run->working->slot_count;
    *contest = (struct contest){.run = run,
                                .blockers = array_new(n, sizeof *contest->blockers),
                                .claims = array_new(n, sizeof *contest->claims),
                                .listed = array_zero(n, 1)};
    if (!contest->blockers || !contest->claims || !contest->listed)
        return false;
    memset(contest->claims, 0xff, n * sizeof *contest->claims);
    return true;
}

void contest_fini(struct contest *contest)
{
    free(contest->blockers);
    free(contest->claims);
    free(contest->listed);
    free(contest->proposing.slots);
    free(contest->later.slots);
    free(contest->won);
}

void contest_renumber(struct contest *contest)
{
    size_t n = contest->run->working->slot_count;
    contest->blockers = array_shrink(contest->blockers, n, sizeof *contest->blockers);
    contest->claims = array_shrink(contest->claims, n, sizeof *contest->claims);
    contest->listed = array_shrink(contest->listed, n, sizeof *contest->listed);
}

/* ---- who takes part */

bool contest_join(struct contest *contest, const struct slot_list *evaluated)
{
    for (size_t i = 0; i < evaluated->count; i++) {
        uint32_t slot = evaluated->slots[i];
        uint64_t priority = contest->run->proposals[slot].priority;
        enum listed place = priority <= contest->bound ? LISTED_NOW : LISTED_LATER;
        contest->blockers[slot] = slot;
        if (priority == PROPOSES_NOTHING || contest->listed[slot] == LISTED_NOW || contest->listed[slot] == place)
            continue;
        contest->listed[slot] = (uint8_t)place;
        if (!list_add(place == LISTED_NOW ? &contest->proposing : &contest->later, slot))
            return false;
    }
    return true;
}

void contest_leave(struct contest *contest)
{
    struct slot_list *list = &contest->proposing;
    size_t kept = 0;
    for (size_t i = 0; i < list->count; i++) {
        uint32_t slot = list->slots[i];
        if (contest->run->proposals[slot].priority != PROPOSES_NOTHING)
            list->slots[kept++] = slot;
        else
            contest->listed[slot] = NOT_LISTED;
    }
    list->count = kept;
}

static int compare_priorities(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* A priority that about one in PART of the later ones is below. */
static uint64_t find_bound(const struct contest *contest)
{
    enum { SAMPLES = 256 };
    uint64_t samples[SAMPLES];
    size_t count = contest->later.count;
    if (count < (size_t)FEW)
        return PROPOSES_NOTHING - 1;
    for (size_t i = 0; i < SAMPLES; i++)
        samples[i] = contest->run->proposals[contest->later.slots[i * count / SAMPLES]].priority;
    qsort(samples, SAMPLES, sizeof *samples, compare_priorities);
    return samples[SAMPLES / PART] < PROPOSES_NOTHING ? samples[SAMPLES / PART] : PROPOSES_NOTHING - 1;
}

/* Moves later proposals up to the bound to those that are compared. */
static bool advance(struct contest *contest)
{
    struct slot_list *later = &contest->later;
    size_t kept = 0;
    for (size_t i = 0; i < later->count; i++) {
        uint32_t slot = later->slots[i];
        uint64_t priority = contest->run->proposals[slot].priority;
        if (contest->listed[slot] != LISTED_LATER)
            continue;
        if (priority > contest->bound && priority != PROPOSES_NOTHING) {
            later->slots[kept++] = slot;
            continue;
        }
        contest->listed[slot] = priority == PROPOSES_NOTHING ? NOT_LISTED : LISTED_NOW;
        if (priority != PROPOSES_NOTHING && !list_add(&contest->proposing, slot))
            return false;
    }
    later->count = kept;
    return true;
}

bool contest_refill(struct contest *contest)
{
    while (contest->later.count &&
           (!contest->proposing.count || contest->proposing.count < contest->later.count / REFILL)) {
        contest->bound = find_bound(contest);
        if (!advance(contest))
            return false;
    }
    return true;
}

/* ---- who wins */

static void claim(uint64_t *claim, uint64_t priority)
{
    uint64_t now = __atomic_load_n(claim, __ATOMIC_RELAXED);
    while (priority < now && !__atomic_compare_exchange_n(claim, &now, priority, true, __ATOMIC_RELAXED,
                                                          __ATOMIC_RELAXED))
        ;
}

static void claim_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct contest *contest = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        uint32_t slot = contest->proposing.slots[i], simplex[4],
                 vertices = proposed_simplex(contest->run, slot, simplex);
        for (uint32_t s = 0; s < vertices; s++)
            claim(&contest->claims[simplex[s]], contest->run->proposals[slot].priority);
    }
}

static void release_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct contest *contest = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        uint32_t simplex[4], vertices = proposed_simplex(contest->run, contest->proposing.slots[i], simplex);
        for (uint32_t s = 0; s < vertices; s++)
            __atomic_store_n(&contest->claims[simplex[s]], PROPOSES_NOTHING, __ATOMIC_RELAXED);
    }
}

/* Is no vertex of the slot's star claimed by a lesser priority? The one that is is remembered. */
static bool unclaimed(const struct contest *contest, uint32_t slot, uint64_t priority, uint32_t *blocker)
{
    const struct span *star = &contest->run->working->stars[slot];
    const uint32_t *tets = contest->run->working->pool + star->begin;
    for (uint32_t i = 0; i < star->count; i++)
        __builtin_prefetch(contest->run->working->corners[tets[i]]);
    for (uint32_t i = 0; i < star->count; i++) {
        const uint32_t *corners = contest->run->working->corners[tets[i]];
        for (int c = 0; c < 4 && corners[0] != TETLOD_NONE; c++)
            if (contest->claims[corners[c]] < priority) {
                *blocker = corners[c];
                return false;
            }
    }
    return true;
}

/* Memory is slow: both ends of proposals are asked for some turns before they are needed. */
static void fetch_stars(const struct contest *contest, const uint32_t *slots, size_t left)
{
    const struct working *working = contest->run->working;
    if (left > 3)
        __builtin_prefetch(&contest->run->proposals[slots[3]]);
    if (left > 2) {
        __builtin_prefetch(&working->stars[slots[2]]);
        __builtin_prefetch(&working->stars[contest->run->proposals[slots[2]].target / 2]);
    }
    if (left > 1) {
        __builtin_prefetch(working->pool + working->stars[slots[1]].begin);
        __builtin_prefetch(working->pool + working->stars[contest->run->proposals[slots[1]].target / 2].begin);
    }
}

static void win_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct contest *contest = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        fetch_stars(contest, contest->proposing.slots + i, end - i);
        uint32_t slot = contest->proposing.slots[i], *blocker = &contest->blockers[slot];
        uint64_t priority = contest->run->proposals[slot].priority;
        uint32_t simplex[4], vertices = proposed_simplex(contest->run, slot, simplex);
        bool won = contest->claims[*blocker] >= priority;
        for (uint32_t s = 0; s < vertices && won; s++)
            won = contest->claims[simplex[s]] >= priority;
        for (uint32_t s = 0; s < vertices && won; s++)
            won = unclaimed(contest, simplex[s], priority, blocker);
        contest->won[i] = won;
    }
}

/* Has a star that the proposal depends on changed since? */
static bool stale(const struct contest *contest, uint32_t slot)
{
    const struct proposal *proposals = contest->run->proposals;
    uint32_t target = proposals[slot].target, simplex[4], vertices;
    if (contest->run->plans) {
        bool stale = false;
        vertices = proposed_simplex(contest->run, slot, simplex);
        for (uint32_t s = 0; s < vertices; s++)
            stale |= !working_alive(contest->run->working,
                                    simplex[s]) || proposals[simplex[s]].changed > proposals[slot].evaluated;
        return stale;
    }
    return proposals[slot].dirty != CLEAN || !working_alive(contest->run->working, target / 2) ||
           (target % 2 && proposals[target / 2].changed > proposals[slot].evaluated);
}

bool contest_decide(struct contest *contest, size_t most, struct slot_list *winners, struct slot_list *out_stale)
{
    size_t count = contest->proposing.count;
    if (!ARRAY_RESERVE(contest->won, contest->won_room, count))
        return false;
    pool_run(contest->run->pool, count, 1024, claim_range, contest);
    pool_run(contest->run->pool, count, 16, win_range, contest);
    pool_run(contest->run->pool, count, 4096, release_range, contest);
    winners->count = out_stale->count = 0;
    for (size_t i = 0; i < count; i++) {
        uint32_t slot = contest->proposing.slots[i];
        if (!contest->won[i])
            continue;
        if (stale(contest, slot) ? !list_add(out_stale, slot)
                                : winners->count < most && !list_add(winners, slot))
            return false;
    }
    return true;
}
