/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/rounds/rounds.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/simplify/rounds/contest.h"
#include "src/simplify/rounds/evaluate.h"
#include "src/simplify/exact/exact.h"
#include "src/simplify/ladder.h"
#include "src/simplify/measured.h"
#include "src/simplify/rounds/merge.h"
#include "src/simplify/mesh/regions.h"
#include "src/simplify/rounds/simplices.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* A vertex whose star has changed is evaluated again if this multiple of what it waited for is within the limit: a
 * change rarely eases it by more. */
static const double EASED = 0.8;

/* Times that a rung looks again at vertices whose stars have changed, if levels are named after it; else the next rung
 * does. */
enum { MAX_PASSES = 3 };

/* Slots that are evaluated between two reports of progress. */
enum { SLICE = 1 << 14 };

/* What a thread's asking came to. */
struct asker {
    struct tetlod_error error;
    enum tetlod_status status;
};

/* So many winners are asked about before they are contracted. */
enum { ASKED = 128 };

struct rounds {
    struct working working;
    struct run run;
    struct contest contest;
    struct slot_list alive; /* slots, ascending */
    struct slot_list winners, again; /* again: to be evaluated */
    struct merged *merged; /* [winner] */
    double *errors;        /* [winner][certified, predicted][component] */
    size_t merged_room, error_room;
    struct limit limit;    /* run.asked, if there is one */
    struct asker *askers;  /* [pool_size] */
    struct answer *answers; /* [ASKED] */
    double *answer_numbers;
    size_t asked_from;     /* the winner of the first of them */
    uint32_t first_record; /* the log's, of the first winner */
    double *certified, *predicted; /* [component] running maxima */
    double moved;
    const struct simplify_options *options;
    struct tetlod_error *error;
};

static enum tetlod_status no_memory(struct rounds *rounds)
{
    return tetlodi_fail_nomem(rounds->error, "the rounds", 0);
}

static bool finished(const struct rounds *rounds)
{
    return rounds->working.tets_alive <= rounds->options->min_tets;
}

/* ---- evaluating */

static enum tetlod_status report(const struct rounds *rounds)
{
    const struct working *working = &rounds->working;
    if (!rounds->options->progress)
        return TETLOD_OK;
    double done = 1 - (double)working->vertices_alive / working->log->vertex_count;
    if (rounds->options->progress(rounds->options->progress_opaque, done))
        return TETLOD_OK;
    return tetlodi_fail(rounds->error, TETLOD_ERR_CANCELLED, "cancelled");
}

static enum tetlod_status failure(struct rounds *rounds)
{
    for (unsigned w = 0; w < pool_size(rounds->run.pool); w++)
        if (rounds->run.workers[w].failed || rounds->run.workers[w].map.failed)
            return no_memory(rounds);
    return TETLOD_OK;
}

static void prune_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct rounds *rounds = context;
    (void)worker;
    for (size_t i = begin; i < end; i++) {
        uint8_t *dirty = &rounds->run.proposals[rounds->again.slots[i]].dirty;
        if (*dirty != CLEAN) // else nothing of it is gone
            working_prune(&rounds->working, rounds->again.slots[i]);
        *dirty = CLEAN;
    }
}

struct slice {
    struct rounds *rounds;
    size_t begin;
};

/* Memory is slow: what evaluating slots in turn will read is asked for some turns before, one step of the way in each
 * turn. */
static void fetch_ahead(const struct working *working, const uint32_t *slots, size_t left)
{
    const struct span *star;
    if (left > 4)
        __builtin_prefetch(&working->stars[slots[4]]);
    if (left > 3)
        __builtin_prefetch(working->pool + working->stars[slots[3]].begin);
    if (left > 2) {
        star = &working->stars[slots[2]];
        for (uint32_t i = 0; i < star->count; i++)
            __builtin_prefetch(working->corners[working->pool[star->begin + i]]);
    }
    if (left > 1) {
        star = &working->stars[slots[1]];
        for (uint32_t i = 0; i < star->count; i++) {
            const uint32_t *corners = working->corners[working->pool[star->begin + i]];
            for (int c = 0; c < 2 && corners[0] != TETLOD_NONE; c++) // each vertex is in several tetrahedra
                __builtin_prefetch(working_row(working, corners[2 * (i % 2) + c]));
        }
    }
}

static void evaluate_range(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct slice *slice = context;
    struct rounds *rounds = slice->rounds;
    const uint32_t *slots = rounds->again.slots + slice->begin;
    for (size_t i = begin; i < end; i++) {
        fetch_ahead(&rounds->working, slots + i, end - i);
        evaluate(&rounds->run, &rounds->run.workers[worker], slots[i]);
    }
}

/* Evaluates the vertices that are listed for it. Stars are pruned first, while nobody reads them. */
static enum tetlod_status evaluate_again(struct rounds *rounds)
{
    size_t count = rounds->again.count;
    pool_run(rounds->run.pool, count, 128, prune_range, rounds);
    for (size_t begin = 0; begin < count; begin += SLICE) {
        struct slice slice = {rounds, begin};
        pool_run(rounds->run.pool, count - begin < SLICE ? count - begin : SLICE, 4, evaluate_range, &slice);
        TETLOD_TRY(failure(rounds));
        if (count > SLICE)
            TETLOD_TRY(report(rounds));
    }
    return TETLOD_OK;
}

/* ---- contracting */

/* Near the least number of tetrahedra only few may go at once. */
static size_t most_winners(const struct rounds *rounds)
{
    enum { REMOVES = 16 }; // a contraction, generously
    uint32_t left = rounds->working.tets_alive - rounds->options->min_tets;
    return left / REMOVES + 1;
}

static double *errors_of(const struct rounds *rounds, size_t winner)
{
    return rounds->errors + winner * 2 * rounds->working.component_count;
}

static void merge_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct rounds *rounds = context;
    for (size_t i = begin; i < end; i++) {
        double *certified = errors_of(rounds, i);
        const struct answer *answer = rounds->run.asked ? &rounds->answers[i - rounds->asked_from] : NULL;
        rounds->merged[i].done = false;
        if (!answer || answer->allowed)
            merge(&rounds->run, &rounds->run.workers[worker], rounds->winners.slots[i],
                  rounds->first_record + (uint32_t)i, answer,
                  &rounds->merged[i], certified, certified + rounds->working.component_count);
    }
}

static enum tetlod_status reserve(struct rounds *rounds)
{
    size_t count = rounds->winners.count, entries = 0;
    bool room = ARRAY_RESERVE(rounds->merged, rounds->merged_room, count) &&
                ARRAY_RESERVE(rounds->errors, rounds->error_room, 2 * count * rounds->working.component_count);
    if (!room)
        return no_memory(rounds);
    for (size_t i = 0; i < count; i++) {
        uint32_t simplex[4], vertices = proposed_simplex(&rounds->run, rounds->winners.slots[i], simplex);
        size_t stars = 0;
        for (uint32_t s = 0; s < vertices; s++)
            stars += rounds->working.stars[simplex[s]].count;
        entries += stars + stars / 4;
    }
    return working_reserve(&rounds->working, entries, rounds->error);
}

static enum tetlod_status mark(struct rounds *rounds)
{
    const struct working *working = &rounds->working;
    return log_mark(working->log, working->vertices_alive, working->tets_alive, rounds->moved, rounds->certified,
                    rounds->predicted, rounds->error);
}

static double shrunk_since_mark(const struct rounds *rounds)
{
    const struct contraction_log *log = rounds->working.log;
    return log->marks[log->mark_count - 1].vertices / (double)rounds->working.vertices_alive;
}

/* Closes the gap that a refused contraction has left in the log. */
static void move_record(struct contraction_log *log, uint32_t from, uint32_t to)
{
    if (from == to)
        return;
    memcpy(log->children + 4 * (size_t)to, log->children + 4 * (size_t)from, 4 * sizeof *log->children);
    memcpy(log->positions + 3 * (size_t)to, log->positions + 3 * (size_t)from, 3 * sizeof *log->positions);
    for (uint32_t f = 0; f < log->field_count; f++) {
        size_t k = log->fields[f].components;
        memcpy(log->fields[f].values + to * k, log->fields[f].values + from * k, k * sizeof(double));
    }
    for (uint32_t c = 0; c < log->component_count && log->components[c].bounds; c++)
        log->components[c].bounds[to] = log->components[c].bounds[from];
}

/* Counts a contraction that is done. */
static enum tetlod_status account(struct rounds *rounds, size_t winner, uint32_t from)
{
    struct working *working = &rounds->working;
    const struct merged *merged = &rounds->merged[winner];
    const double *errors = errors_of(rounds, winner);
    uint32_t k = working->component_count, record = log_extend(working->log, 1);
    move_record(working->log, from, record);
    working->node[merged->kept] = working->log->vertex_count + record;
    working->vertices_alive -= merged->vertices;
    working->tets_alive -= merged->removed;
    rounds->moved = fmax(rounds->moved, merged->moved);
    for (uint32_t c = 0; c < k; c++) {
        rounds->certified[c] = fmax(rounds->certified[c], errors[c]);
        rounds->predicted[c] = fmax(rounds->predicted[c], errors[k + c]);
    }
    return shrunk_since_mark(rounds) >= rounds->options->growth ? mark(rounds) : TETLOD_OK;
}

static void classify_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct rounds *rounds = context;
    (void)worker;
    for (size_t i = begin; i < end; i++)
        if (working_alive(&rounds->working, rounds->winners.slots[i]))
            border_classify(&rounds->run.border, &rounds->working, rounds->winners.slots[i]);
}

/* The workers' lists of one kind, each slot once, in the place of the winners, who are done. */
static enum tetlod_status collect(struct rounds *rounds, bool unfreezing)
{
    struct slot_list *list = &rounds->winners;
    struct proposal *proposals = rounds->run.proposals;
    list->count = 0;
    for (unsigned w = 0; w < pool_size(rounds->run.pool); w++) {
        struct worker *worker = &rounds->run.workers[w];
        size_t *count = unfreezing ? &worker->unfreezing_count : &worker->open_count;
        const uint32_t *slots = unfreezing ? worker->unfreezing : worker->open;
        for (size_t i = 0; i < *count; i++) {
            if (!proposals[slots[i]].collected && !list_add(list, slots[i]))
                return no_memory(rounds);
            proposals[slots[i]].collected = true;
        }
        *count = 0;
    }
    for (size_t i = 0; i < list->count; i++)
        proposals[list->slots[i]].collected = false;
    return TETLOD_OK;
}

/* A frozen vertex whose last degenerate, inverted or folded tetrahedron is gone is free. */
static void unfreeze(struct rounds *rounds, uint32_t slot)
{
    struct working *working = &rounds->working;
    const struct span *star = &working->stars[slot];
    if (!working_alive(working, slot))
        return;
    for (uint32_t i = 0; i < star->count; i++) {
        uint32_t tet = working->pool[star->begin + i];
        if (!tet_gone(working, tet) && (working_orientation(working, tet) <= 0 || border_folded(working, tet)))
            return;
    }
    working->flags[slot] &= (uint8_t)~VERTEX_FROZEN;
    rounds->run.proposals[slot].waits = rounds->run.proposals[slot].waits_changed = 0;
    rounds->run.proposals[slot].changed = rounds->run.round;
}

/* ---- a limit that is asked */

static void ask_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct rounds *rounds = context;
    struct asker *asker = &rounds->askers[worker];
    for (size_t i = begin; i < end && asker->status == TETLOD_OK; i++)
        asker->status = simplex_ask(&rounds->run, &rounds->run.workers[worker], worker,
                                    rounds->winners.slots[rounds->asked_from + i],
                                    &rounds->answers[i], &asker->error);
}

/* Takes the answers over in turn. What is refused proposes something else. */
static enum tetlod_status take_answers(struct rounds *rounds, size_t count)
{
    const struct limit *limit = rounds->run.asked;
    struct star *star = &rounds->run.workers[0].star;
    for (size_t i = 0; i < count; i++) {
        struct answer *answer = &rounds->answers[i];
        uint32_t simplex[4], slot = rounds->winners.slots[rounds->asked_from +
                                                          i], vertices = proposed_simplex(&rounds->run, slot, simplex);
        if (!star_gather(star, &rounds->working, simplex, vertices))
            return no_memory(rounds);
        TETLOD_TRY(limit->take(limit->state, star, answer, rounds->error));
        if (answer->allowed)
            continue;
        simplex_refused(&rounds->run, slot, answer->error);
        if (!list_add(&rounds->again, slot))
            return no_memory(rounds);
    }
    return TETLOD_OK;
}

static void merge_asked_range(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct rounds *rounds = context;
    merge_range(context, worker, rounds->asked_from + begin, rounds->asked_from + end);
}

static enum tetlod_status ask_and_merge(struct rounds *rounds)
{
    size_t winners = rounds->winners.count;
    for (rounds->asked_from = 0; rounds->asked_from < winners; rounds->asked_from += ASKED) {
        size_t count = winners - rounds->asked_from < ASKED ? winners - rounds->asked_from : ASKED;
        pool_run(rounds->run.pool, count, 1, ask_range, rounds);
        for (unsigned w = 0; w < pool_size(rounds->run.pool); w++)
            if (rounds->askers[w].status != TETLOD_OK) {
                *rounds->error = rounds->askers[w].error;
                return rounds->askers[w].status;
            }
        TETLOD_TRY(failure(rounds));
        TETLOD_TRY(take_answers(rounds, count));
        pool_run(rounds->run.pool, count, 4, merge_asked_range, rounds);
        for (size_t i = 0; i < count; i++)
            answer_fini(&rounds->answers[i]);
    }
    return TETLOD_OK;
}

/* Contracts the winners; what they made is to be evaluated again, too. */
static enum tetlod_status contract(struct rounds *rounds)
{
    uint32_t first = rounds->first_record = rounds->working.log->count;
    TETLOD_TRY(reserve(rounds));
    if (rounds->run.asked)
        TETLOD_TRY(ask_and_merge(rounds));
    else
        pool_run(rounds->run.pool, rounds->winners.count, 2, merge_range, rounds);
    TETLOD_TRY(failure(rounds));
    for (size_t i = 0; i < rounds->winners.count; i++) {
        if (!rounds->merged[i].done)
            continue;
        TETLOD_TRY(account(rounds, i, first + (uint32_t)i));
    }
    TETLOD_TRY(collect(rounds, false));
    pool_run(rounds->run.pool, rounds->winners.count, 16, classify_range, rounds);
    TETLOD_TRY(collect(rounds, true));
    for (size_t i = 0; i < rounds->winners.count; i++)
        unfreeze(rounds, rounds->winners.slots[i]);
    return TETLOD_OK;
}

/* ---- rungs */

/* Until there is nothing to propose any more. */
static enum tetlod_status play_rounds(struct rounds *rounds)
{
    struct contest *contest = &rounds->contest;
    if (!contest_refill(contest))
        return no_memory(rounds);
    while (contest->proposing.count && !finished(rounds)) {
        rounds->run.round++;
        if (!contest_decide(contest, most_winners(rounds), &rounds->winners, &rounds->again))
            return no_memory(rounds);
        TETLOD_TRY(contract(rounds));
        TETLOD_TRY(evaluate_again(rounds));
        contest_leave(contest);
        if (!contest_join(contest, &rounds->again) || !contest_refill(contest))
            return no_memory(rounds);
        TETLOD_TRY(report(rounds));
    }
    return TETLOD_OK;
}

/* Lists whom the limit may have reached; those that have died leave. */
static enum tetlod_status list_reached(struct rounds *rounds)
{
    const struct proposal *proposals = rounds->run.proposals;
    size_t kept = 0;
    double limit = rounds->run.limit * (1 + 1e-6); // what waits is stored as float
    rounds->again.count = 0;
    for (size_t i = 0; i < rounds->alive.count; i++) {
        uint32_t slot = rounds->alive.slots[i];
        if (!working_alive(&rounds->working, slot))
            continue;
        rounds->alive.slots[kept++] = slot;
        double waits = proposals[slot].dirty == CLEAN ? proposals[slot].waits : EASED * proposals[slot].waits_changed;
        if (waits > limit && rounds->run.plans && proposals[slot].waits_changed * EASED <= limit &&
            simplices_changed(&rounds->run, slot))
            waits = limit;
        if (waits <= limit && proposals[slot].priority == PROPOSES_NOTHING && !list_add(&rounds->again, slot))
            return no_memory(rounds);
    }
    rounds->alive.count = kept;
    return TETLOD_OK;
}

/* Has what the slot may propose changed since it was evaluated, or was passed over on this rung? */
static bool has_changed(const struct rounds *rounds, uint32_t slot)
{
    const struct proposal *proposal = &rounds->run.proposals[slot];
    if (!rounds->run.plans)
        return proposal->dirty == TOUCHED;
    return EASED * proposal->waits_changed <= rounds->run.limit && simplices_changed(&rounds->run, slot);
}

/* Lists whose stars have changed since they were evaluated and may have come within the limit. */
static enum tetlod_status list_changed(struct rounds *rounds)
{
    struct proposal *proposals = rounds->run.proposals;
    rounds->again.count = 0;
    for (size_t i = 0; i < rounds->alive.count; i++) {
        uint32_t slot = rounds->alive.slots[i];
        if (!working_alive(&rounds->working, slot) || proposals[slot].priority != PROPOSES_NOTHING ||
            !has_changed(rounds, slot))
            continue;
        if (!rounds->run.plans)
            proposals[slot].dirty = LEFT;
        if (EASED * proposals[slot].waits_changed <= rounds->run.limit && !list_add(&rounds->again, slot))
            return no_memory(rounds);
    }
    return TETLOD_OK;
}

/* ---- memory */

/* New numbers are worth it when one in so many tetrahedra is gone, and where a limit's own data grow meanwhile. */
enum { RENUMBER_PART = 16 };

static enum tetlod_status renumber(struct rounds *rounds)
{
    struct working *working = &rounds->working;
    struct run *run = &rounds->run;
    struct renumbering numbers;
    if (!run->asked || working->tet_count - working->tets_alive < working->tet_count / RENUMBER_PART)
        return TETLOD_OK;
    TETLOD_TRY(working_renumber(working, &numbers, rounds->error));
    run->proposals = renumber_slots(&numbers, run->proposals, sizeof *run->proposals);
    run->plans = renumber_slots(&numbers, run->plans, sizeof *run->plans);
    run->notes = renumber_slots(&numbers, run->notes, sizeof *run->notes);
    contest_renumber(&rounds->contest);
    quadrics_renumber(&run->quadrics, working, &numbers);
    border_renumber(&run->border, &numbers);
    run->asked->renumber(run->asked->state, &numbers);
    size_t kept = 0;
    for (size_t i = 0; i < rounds->alive.count; i++)
        if (numbers.slots[rounds->alive.slots[i]] != TETLOD_NONE)
            rounds->alive.slots[kept++] = numbers.slots[rounds->alive.slots[i]];
    rounds->alive.count = kept;
    renumbering_fini(&numbers);
    return TETLOD_OK;
}

static enum tetlod_status climb_rung(struct rounds *rounds, double limit, bool named)
{
    rounds->run.limit = limit;
    rounds->run.named = named;
    rounds->contest.bound = 0;
    rounds->run.round++;
    TETLOD_TRY(list_reached(rounds));
    for (int pass = 0; rounds->again.count && !finished(rounds); pass++) {
        TETLOD_TRY(evaluate_again(rounds));
        if (!contest_join(&rounds->contest, &rounds->again))
            return no_memory(rounds);
        TETLOD_TRY(play_rounds(rounds));
        rounds->again.count = 0;
        if (pass == (named || rounds->run.plans ? MAX_PASSES : 0))
            break;
        TETLOD_TRY(list_changed(rounds));
        rounds->run.round++;
    }
    return TETLOD_OK;
}

static double next_rung(const struct rounds *rounds, double limit, bool *out_named)
{
    const struct simplify_options *options = rounds->options;
    double steps_from = rounds->run.plans ? 0 : options->rung_count ? INFINITY : STEPS_FROM;
    double next = next_limit(limit, options->max_error, steps_from, out_named);
    for (uint32_t i = 0; i < options->rung_count; i++)
        if (options->rungs[i] > limit * (1 + 1e-6) && options->rungs[i] < next) {
            next = options->rungs[i];
            *out_named = true;
        }
    return next;
}

/* From a first limit on. */
static enum tetlod_status climb(struct rounds *rounds, double from)
{
    bool named = true;
    double limit = fmin(from, rounds->options->max_error);
    TETLOD_TRY(mark(rounds));
    for (;;) {
        TETLOD_TRY(climb_rung(rounds, limit, named));
        if (shrunk_since_mark(rounds) > (named ? 1 : sqrt(rounds->options->growth)))
            TETLOD_TRY(mark(rounds));
        if (finished(rounds) || limit >= rounds->options->max_error)
            break;
        TETLOD_TRY(renumber(rounds));
        limit = next_rung(rounds, limit, &named);
    }
    return mark(rounds);
}

/* ---- set-up */

/* Edges by their envelope, many at one look at a star. */
static bool in_edges_alone(const struct simplify_options *options)
{
    return options->metric == METRIC_ENVELOPE && options->certify == CERTIFY_FAST &&
           options->contract == CONTRACT_EDGES;
}

/* A limit that is asked goes by quadrics. */
static enum metric order_of(const struct simplify_options *options)
{
    bool asked = options->certify == CERTIFY_EXACT || options->metric == METRIC_MEASURED;
    return asked && options->metric != METRIC_QUADRIC ? METRIC_FIELD_QUADRIC : options->metric;
}

static bool has_quadrics(enum metric order)
{
    return order == METRIC_FIELD_QUADRIC || order == METRIC_QUADRIC;
}

uint64_t rounds_bytes(const struct tetmesh *mesh, uint32_t controlled_count, const struct simplify_options *options)
{
    uint64_t claim = sizeof(uint64_t), blocker = sizeof(uint32_t), lists = 1 + sizeof(uint32_t),
             edges = (uint64_t)mesh->vertex_count + mesh->tet_count;
    uint64_t bytes = evaluate_bytes(mesh, controlled_count) + mesh->vertex_count * (claim + blocker + lists);
    unsigned threads = options->threads ? options->threads : parallel_cores();
    if (in_edges_alone(options))
        return bytes;
    bytes += mesh->vertex_count * (uint64_t)(sizeof(struct plan) + sizeof(struct notes) +
                                             16) + edges * sizeof(struct known);
    if (has_quadrics(order_of(options)))
        bytes += mesh->vertex_count * (uint64_t)controlled_count * QUADRIC_SIZE * sizeof(double);
    if (options->certify == CERTIFY_EXACT)
        bytes += exact_bytes(mesh->vertex_count, mesh->tet_count, threads);
    else if (options->metric == METRIC_MEASURED)
        bytes += measured_bytes(mesh, controlled_count);
    return bytes;
}

/* What vertices need that are evaluated simplex by simplex. */
static enum tetlod_status allocate_plans(struct rounds *rounds)
{
    size_t n = rounds->working.slot_count, k = rounds->working.component_count;
    rounds->run.plans = array_zero(n, sizeof *rounds->run.plans);
    rounds->run.notes = array_zero(n, sizeof *rounds->run.notes);
    if (!rounds->run.plans || !rounds->run.notes)
        return no_memory(rounds);
    if (has_quadrics(rounds->run.metric))
        TETLOD_TRY(quadrics_init(&rounds->run.quadrics, &rounds->working, rounds->run.metric == METRIC_QUADRIC,
                                 rounds->error));
    if (!rounds->run.asked)
        return TETLOD_OK;
    rounds->askers = array_zero(pool_size(rounds->run.pool), sizeof *rounds->askers);
    rounds->answers = array_zero(ASKED, sizeof *rounds->answers);
    rounds->answer_numbers = array_zero(2 * ASKED * k, sizeof(double));
    if (!rounds->askers || !rounds->answers || !rounds->answer_numbers)
        return no_memory(rounds);
    for (size_t i = 0; i < ASKED; i++) {
        rounds->answers[i].values = rounds->answer_numbers + 2 * i * k;
        rounds->answers[i].errors = rounds->answers[i].values + k;
    }
    return TETLOD_OK;
}

static enum tetlod_status allocate(struct rounds *rounds)
{
    size_t n = rounds->working.slot_count, k = rounds->working.component_count;
    rounds->run.proposals = proposals_new(n);
    rounds->certified = array_zero(k, sizeof(double));
    rounds->predicted = array_zero(k, sizeof(double));
    rounds->run.factors = array_zero(k, sizeof(double));
    rounds->run.workers = array_zero(pool_size(rounds->run.pool), sizeof *rounds->run.workers);
    if (!rounds->run.proposals || !rounds->certified || !rounds->predicted || !rounds->run.factors ||
        !rounds->run.workers ||
        !contest_init(&rounds->contest, &rounds->run))
        return no_memory(rounds);
    for (unsigned w = 0; w < pool_size(rounds->run.pool); w++)
        if (!worker_init(&rounds->run.workers[w], &rounds->working))
            return no_memory(rounds);
    if (!in_edges_alone(rounds->options))
        TETLOD_TRY(allocate_plans(rounds));
    for (size_t c = 0; c < k; c++)
        rounds->run.factors[c] = rounds->working.components[c].factor;
    rounds->run.certified = rounds->certified;
    for (uint32_t v = 0; v < n; v++)
        if (!list_add(&rounds->alive, v))
            return no_memory(rounds);
    return TETLOD_OK;
}

static void rounds_fini(struct rounds *rounds)
{
    for (unsigned w = 0; rounds->run.workers && w < pool_size(rounds->run.pool); w++)
        worker_fini(&rounds->run.workers[w]);
    for (uint32_t v = 0; v < rounds->working.slot_count && rounds->run.notes; v++)
        notes_free(&rounds->run.notes[v]);
    for (size_t i = 0; i < ASKED && rounds->answers; i++)
        answer_fini(&rounds->answers[i]);
    quadrics_fini(&rounds->run.quadrics);
    void *const owned[] = {rounds->run.plans,   rounds->run.notes,     rounds->askers,       rounds->answers,
                           rounds->answer_numbers, rounds->run.workers, rounds->run.factors,  rounds->run.proposals,
                           rounds->alive.slots, rounds->again.slots,   rounds->winners.slots, rounds->merged,
                           rounds->errors,      rounds->certified,     rounds->predicted};
    for (size_t i = 0; i < sizeof owned / sizeof *owned; i++)
        free(owned[i]);
    if (rounds->limit.state)
        rounds->limit.release(rounds->limit.state);
    contest_fini(&rounds->contest);
    border_fini(&rounds->run.border);
    pool_free(rounds->run.pool);
    working_fini(&rounds->working);
}

static enum tetlod_status open_rounds(struct rounds *rounds)
{
    unsigned threads = rounds->options->threads;
    rounds->run.working = &rounds->working;
    rounds->run.metric = order_of(rounds->options);
    rounds->run.contract = rounds->options->contract;
    rounds->run.kernels = kernels_choose();
    rounds->run.pool = pool_new(threads ? threads : parallel_cores());
    return rounds->run.pool ? TETLOD_OK : no_memory(rounds);
}

/* Ends the log, and frees all else. */
static enum tetlod_status close_rounds(struct rounds *rounds, struct contraction_log *log, enum tetlod_status status)
{
    for (unsigned w = 0; rounds->run.workers && w < pool_size(rounds->run.pool); w++)
        for (int r = 0; r < LOG_REFUSALS; r++)
            log->refused[r] += rounds->run.workers[w].refused[r];
    rounds_fini(rounds);
    if (status == TETLOD_OK)
        log_finish(log);
    else
        log_fini(log);
    return status;
}

enum tetlod_status rounds_simplify(struct contraction_log *out, const struct tetmesh *mesh, const uint32_t *controlled,
                                   uint32_t controlled_count, const double *limits,
                                   const struct simplify_options *options, struct tetlod_error *error)
{
    struct rounds rounds = {.options = options, .error = error};
    enum tetlod_status status;
    TETLOD_TRY(log_init(out, mesh, error));
    TETLOD_TRY_DONE(open_rounds(&rounds));
    TETLOD_TRY_DONE(working_init(&rounds.working, mesh, NULL, controlled, controlled_count, limits, out, error));
    if (options->local_bound)
        TETLOD_TRY_DONE(log_keep_bounds(out, error));
    TETLOD_TRY_DONE(regions_fix(mesh, options->regions, rounds.working.node, rounds.working.flags, error));
    regions_fix_vertices(mesh->vertex_count, options->fixed, rounds.working.node, rounds.working.flags);
    TETLOD_TRY_DONE(report(&rounds));
    TETLOD_TRY_DONE(border_find(&rounds.working, rounds.run.pool, error));
    TETLOD_TRY_DONE(report(&rounds));
    TETLOD_TRY_DONE(border_init(&rounds.run.border, &rounds.working, mesh, options->boundary_angle,
                                options->boundary_limit,
                                options->boundary_least, pool_size(rounds.run.pool), error));
    if (options->certify == CERTIFY_EXACT)
        TETLOD_TRY_DONE(exact_new(&rounds.limit, mesh, &rounds.working, pool_size(rounds.run.pool), error));
    else if (options->metric == METRIC_MEASURED)
        TETLOD_TRY_DONE(measured_new(&rounds.limit, mesh, &rounds.working, pool_size(rounds.run.pool), error));
    rounds.run.asked = rounds.limit.state ? &rounds.limit : NULL;
    TETLOD_TRY_DONE(allocate(&rounds));
    status = climb(&rounds, FIRST_LIMIT);
done:
    return close_rounds(&rounds, out, status);
}

enum tetlod_status rounds_contract(struct contraction_log *out, struct piece *piece, double from,
                                   const struct simplify_options *options, struct tetlod_error *error)
{
    struct rounds rounds = {.options = options, .error = error};
    struct piece_state *state = &piece->state;
    enum tetlod_status status;
    TETLOD_TRY(log_init(out, &piece->mesh, error));
    TETLOD_TRY_DONE(open_rounds(&rounds));
    rounds.run.box = options->box;
    TETLOD_TRY_DONE(piece_open(piece, &rounds.working, out, error));
    if (options->local_bound)
        TETLOD_TRY_DONE(log_keep_bounds(out, error));
    TETLOD_TRY_DONE(border_resume(&rounds.run.border, &rounds.working, piece->most, options->boundary_angle,
                                  options->boundary_limit, error));
    TETLOD_TRY_DONE(allocate(&rounds));
    size_t size = rounds.working.component_count * sizeof(double);
    memcpy(rounds.certified, state->certified, size);
    memcpy(rounds.predicted, state->predicted, size);
    rounds.moved = state->moved;
    TETLOD_TRY_DONE(climb(&rounds, from));
    TETLOD_TRY_DONE(piece_take(piece, &rounds.working, &rounds.run.border, error));
    memcpy(state->certified, rounds.certified, size);
    memcpy(state->predicted, rounds.predicted, size);
    state->moved = rounds.moved;
    status = TETLOD_OK;
done:
    return close_rounds(&rounds, out, status);
}
