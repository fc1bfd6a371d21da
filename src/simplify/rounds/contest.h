/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Which proposals of a round win: those around whose vertices none is claimed by a lesser priority. So winners' stars
 * do not overlap. Nothing depends on how many threads there are: claims are minima, and lists are made in order.
 */
#ifndef TETLOD_CONTEST_H
#define TETLOD_CONTEST_H

#include "src/simplify/rounds/run.h"
#include "src/util/array.h"

struct slot_list {
    uint32_t *slots;
    size_t count, room;
};

/* False: no memory. */
static inline bool list_add(struct slot_list *list, uint32_t slot)
{
    void *grown = list->slots;
    if (!array_reserve(&grown, &list->room, list->count + 1, sizeof *list->slots))
        return false;
    list->slots = grown;
    list->slots[list->count++] = slot;
    return true;
}

struct contest {
    const struct run *run;
    uint32_t *blockers; /* [slot] a vertex around it that had a lesser priority, or itself */
    uint64_t *claims;   /* [slot] the least priority of a proposal with that vertex in this round */
    uint8_t *listed;    /* [slot] enum listed */
    struct slot_list proposing, later; /* slots with proposals up to `bound`, and those beyond (some more than once) */
    uint64_t bound;     /* of the priorities that are compared now */
    uint8_t *won;       /* [proposing] */
    size_t won_room;
};

/* Of the run's working mesh. False, here and below: no memory. */
bool contest_init(struct contest *contest, const struct run *run);
void contest_fini(struct contest *contest);

/* Between rungs, when nobody takes part: the working mesh has other numbers. */
void contest_renumber(struct contest *contest);

/* Those that were evaluated and have something to propose join the others. */
bool contest_join(struct contest *contest, const struct slot_list *evaluated);

/* Those that have nothing to propose any more leave. */
void contest_leave(struct contest *contest);

/* When few proposals are left the next best join them. So what is far from being the least is not compared in each
 * round. */
bool contest_refill(struct contest *contest);

/* Lists at most so many winners whose proposals hold; those that do not are to be evaluated again. */
bool contest_decide(struct contest *contest, size_t most, struct slot_list *winners, struct slot_list *out_stale);

#endif
