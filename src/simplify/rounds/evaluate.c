/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * 1. Gather the star, compute its planes (star_data.h, kernels.h).
 * 2. Look at every edge that the boundary's kinds allow: the error at the other end, and for the middle what this star
 * says.
 * 3. Best key first: ask of each candidate what is expensive, the other star at a middle, flips to the letter, the link
 *    condition, the boundary map; the first that passes is proposed.
 */
#include "src/simplify/rounds/evaluate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/simplify/rounds/outcome.h"
#include "src/simplify/rounds/simplices.h"
#include "src/util/array.h"

/* Errors are followed to this multiple of the limit and at least so far, so that what waits is not looked at on the
 * next rungs. */
static const double CUTOFF = 2, MIN_CUTOFF = 0.01;

/* The other half of a middle is followed to this multiple only: it is asked for one edge at a time. */
static const double HALF_CUTOFF = 1.5;

/* Middles whose other half is examined in one evaluation; if more look good, the vertex is looked at again on the next
 * rung. */
enum { MAX_MIDDLES = 3 };

/* Bits of the key that do not count in a priority: keys in steps of half an octave. */
enum { COARSE_KEYS = 46 };

void middle_of(const struct working *working, uint32_t from, uint32_t to, double p[3])
{
    const double *a = working_row(working, from), *b = working_row(working, to);
    for (int i = 0; i < 3; i++)
        p[i] = a[i] + 0.5 * (b[i] - a[i]);
    working_round(working, p);
}

uint64_t evaluate_bytes(const struct tetmesh *mesh, uint32_t controlled_count)
{
    uint64_t components = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        components += mesh->fields[f].components;
    // of two threads' star_data
    uint64_t log = 16 + 24 + 8 * components, border = 8 + 1 + 12, numbers = 2 * sizeof(uint32_t);
    return working_bytes(mesh, controlled_count) + mesh->vertex_count * (log + border + numbers +
                                                                         sizeof(struct proposal));
}

struct proposal *proposals_new(size_t count)
{
    struct proposal *proposals = array_zero(count, sizeof *proposals);
    for (size_t slot = 0; slot < count && proposals; slot++)
        proposals[slot].priority = PROPOSES_NOTHING;
    return proposals;
}

bool worker_init(struct worker *worker, const struct working *working)
{
    worker->numbers = array_zero(NUMBERS * (size_t)working->component_count, sizeof(double));
    worker->trials = trials_new();
    worker->star_values = array_new((working->value_count + WIDE - 1) / WIDE, sizeof *worker->star_values);
    return worker->numbers && worker->star_values && worker->trials;
}

void worker_fini(struct worker *worker)
{
    star_data_fini(&worker->data);
    links_fini(&worker->links);
    star_fini(&worker->star);
    trials_free(worker->trials);
    boundary_map_fini(&worker->map);
    for (int k = 0; k < 4; k++)
        free(worker->weighing.rows[k]);
    for (int k = 0; k < 3; k++)
        free(worker->weighing.weights[k]);
    free(worker->weighing.slots);
    free(worker->weighing.moves);
    free(worker->weighing.spread);
    free(worker->weighing.shares);
    free(worker->candidates);
    free(worker->list);
    free(worker->numbers);
    free(worker->star_values);
    free(worker->open);
    free(worker->unfreezing);
}

/* ---- step 2 */

static double cutoff(const struct run *run)
{
    return larger(CUTOFF * run->limit, MIN_CUTOFF);
}

static double key_of(double error, uint32_t removed)
{
    return error / (removed * sqrt(removed));
}

/* The boundary's say on the two positions of an edge: at the other end, and in the middle. */
static bool allowed(const struct run *run, const struct star_data *data, uint32_t neighbour, bool *out_end,
                    bool *out_middle)
{
    const struct working *working = run->working;
    uint32_t other = data->slots[neighbour];
    bool own_open = working->flags[data->vertex] & VERTEX_BOUNDARY, open = working->flags[other] & VERTEX_BOUNDARY;
    *out_end = true;
    *out_middle = data->vertex < other && own_open == open && !(working->flags[other] & VERTEX_FIXED);
    if (working->flags[other] & (VERTEX_FROZEN | VERTEX_SINGULAR))
        return false;
    if (!own_open)
        return true;
    if (!data->along[neighbour]) // it leads inside, or to another part of the boundary
        return false;
    const double *step = data->rows + (size_t)neighbour * working->stride;
    double half[3] = {0.5 * step[0], 0.5 * step[1], 0.5 * step[2]}, back[3] = {-half[0], -half[1], -half[2]};
    *out_end = border_may_move(&run->border, data->vertex, step);
    *out_middle = *out_middle && border_may_move(&run->border, data->vertex, half) &&
                  border_may_move(&run->border, other, back);
    return *out_end || *out_middle;
}

/* The least errors that contractions of the vertex wait for (evaluate.h). */
struct waiting {
    double possible, any;
};

static void wait_for(struct waiting *waiting, double error, bool possible)
{
    waiting->any = smaller(waiting->any, error);
    if (possible)
        waiting->possible = smaller(waiting->possible, error);
}

static void consider(const struct run *run, struct worker *worker, struct candidate candidate, bool possible,
                     bool followed, uint32_t *count, struct waiting *waiting)
{
    double limit = run->limit * (1 + LIMIT_TIE);
    if (!(candidate.error <= limit) || !(possible && followed)) {
        wait_for(waiting, candidate.error, possible || !followed);
        return;
    }
    candidate.key = key_of(candidate.error, worker->data.shared[candidate.neighbour]);
    worker->candidates[(*count)++] = candidate;
}

/* All edges. Returns how many candidates are within the limit, as far as this star says. */
static uint32_t query_edges(const struct run *run, struct worker *worker, struct waiting *waiting)
{
    struct star_data *data = &worker->data;
    uint32_t count = 0;
    struct edge_query query = {run->working->component_count, run->factors, numbers_of(run, worker, NUMBERS_GAP), 1,
                               cutoff(run)};
    for (uint32_t n = 0; n < data->count; n++) {
        bool end, middle;
        if (!allowed(run, data, n, &end, &middle))
            continue;
        query.part = middle ? 0.5 : 1;
        struct edge_answer answer = run->kernels->query_edge(data, n, &query, run->working->stride);
        const double *reach = data->reach + 2 * (size_t)n * query.components;
        if (middle)
            consider(run, worker, (struct candidate){.error = answer.error, .neighbour = n, .middle = true},
                     !answer.half_turned, answer.followed, &count, waiting);
        double error = middle ? 0 : answer.error;
        for (uint32_t c = 0; c < query.components && middle; c++)
            error = larger(error, (query.gaps[c] + reach[2 * c] - reach[2 * c + 1]) / 2 * query.factors[c]);
        if (end)
            consider(run, worker, (struct candidate){.error = error, .neighbour = n},
                     answer.turned <= data->shared[n], answer.followed, &count, waiting);
    }
    return count;
}

/* ---- step 3 */

/* U and L of the result as far as the stars say; for a middle the other half is asked for. False: something turns over
 * there. */
static bool set_bounds(const struct run *run, struct worker *worker, const struct candidate *candidate)
{
    const struct working *working = run->working;
    const struct star_data *data = &worker->data;
    uint32_t other = data->slots[candidate->neighbour], components = working->component_count;
    const double *reach = data->reach + 2 * (size_t)candidate->neighbour * components,
                 *own = working_row(working, data->vertex);
    double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    double part = candidate->middle ? 0.5 : 1;
    for (uint32_t c = 0; c < components; c++) {
        upper[c] = part * reach[2 * c];
        lower[c] = part * reach[2 * c + 1];
    }
    if (candidate->middle) {
        double *rise = numbers_of(run, worker, NUMBERS_RISE);
        for (uint32_t f = 0; f < 2 * components; f++)
            rise[f] = working_row(working, other)[ROW_FIELDS + f] - own[ROW_FIELDS + f];
        struct edge_query query = {components, run->factors, numbers_of(run, worker, NUMBERS_GAP), 0.5,
                                   HALF_CUTOFF * run->limit};
        struct half half = {upper, lower, rise, 0};
        if (!run->kernels->halfway(working, other, data->vertex, &query, &half))
            return false;
    }
    for (uint32_t c = 0; c < components; c++) {
        upper[c] += own[ROW_FIELDS + 2 * c];
        lower[c] += own[ROW_FIELDS + 2 * c + 1];
    }
    return true;
}

/* Would the star's own tetrahedra that are kept be well oriented with the vertex at p? */
static bool fits(const struct run *run, struct star_data *data, uint32_t neighbour, const double p[3])
{
    const struct working *working = run->working;
    double r[3];
    subtract(p, working_row(working, data->vertex), r);
    uint32_t count = run->kernels->doubt(data, working->component_count, r);
    for (uint32_t j = 0; j < count; j++) {
        uint32_t i = data->doubtful[j], a = data->corners[0][i], b = data->corners[1][i], c = data->corners[2][i];
        if (a != neighbour && b != neighbour && c != neighbour &&
            tet_orientation(p, working_row(working, data->slots[a]), working_row(working, data->slots[b]),
                            working_row(working, data->slots[c])) <= 0)
            return false;
    }
    return true;
}

static enum log_refusal refuse(struct worker *worker, enum log_refusal refusal)
{
    worker->refused[refusal]++;
    return refusal;
}

/* Asks all that was not asked yet. LOG_REFUSALS: it passes; candidate->error is what it needs. */
static enum log_refusal examine(const struct run *run, struct worker *worker, struct candidate *candidate)
{
    const struct working *working = run->working;
    const struct star_data *data = &worker->data;
    uint32_t ends[2] = {data->vertex, data->slots[candidate->neighbour]};
    double p[3];
    bool room;
    if (!set_bounds(run, worker, candidate))
        return refuse(worker, LOG_REFUSED_FLIP);
    candidate->error = larger(candidate->error, outcome_middles(run, worker, NULL));
    if (candidate->error > run->limit * (1 + LIMIT_TIE))
        return LOG_REFUSALS;
    if (candidate->middle)
        middle_of(working, ends[0], ends[1], p);
    else
        memcpy(p, working_row(working, ends[1]), sizeof p);
    if (!fits(run, &worker->data, candidate->neighbour, p))
        return refuse(worker, LOG_REFUSED_FLIP);
    bool open = working->flags[data->vertex] & VERTEX_BOUNDARY;
    if (open && isinf(border_moves(&run->border, working, ends, 2, p, &worker->map)))
        return refuse(worker, LOG_REFUSED_BOUNDARY);
    if (!links_hold(&worker->links, data, working, candidate->neighbour, &room)) { // which is seldom
        worker->failed |= !room;
        return refuse(worker, LOG_REFUSED_LINK);
    }
    if (!open)
        return LOG_REFUSALS;
    outcome_demands(run, worker);
    candidate->error = larger(candidate->error, outcome_middles(run, worker, NULL));
    return LOG_REFUSALS;
}

static void propose(const struct run *run, struct worker *worker, uint32_t slot, const struct candidate *candidate)
{
    run->proposals[slot].priority = priority_of(key_of(candidate->error, worker->data.shared[candidate->neighbour]),
                                                slot, COARSE_KEYS);
    run->proposals[slot].target = 2 * worker->data.slots[candidate->neighbour] + candidate->middle;
}

/* Examines candidates, best first, until one passes. */
static bool choose(const struct run *run, struct worker *worker, uint32_t slot, uint32_t count, struct waiting *waiting)
{
    struct candidate *candidates = worker->candidates;
    double limit = run->limit * (1 + LIMIT_TIE);
    int middles = 0; // examined
    while (count) {
        uint32_t best = 0;
        for (uint32_t i = 1; i < count; i++)
            best = candidates[i].key < candidates[best].key ? i : best;
        struct candidate candidate = candidates[best];
        if (candidate.passed) {
            propose(run, worker, slot, &candidate);
            return true;
        }
        enum log_refusal refusal = LOG_REFUSALS;
        if (candidate.middle && middles == MAX_MIDDLES)
            candidate.error = limit * 1.0001;
        else
            refusal = examine(run, worker, &candidate);
        middles += candidate.middle;
        // it needs more than it seemed to: others may be better now
        if (refusal == LOG_REFUSALS && candidate.error <= limit) {
            candidate.key = key_of(candidate.error, worker->data.shared[candidate.neighbour]);
            candidate.passed = true;
            candidates[best] = candidate;
        } else {
            wait_for(waiting, candidate.error, refusal == LOG_REFUSALS);
            candidates[best] = candidates[--count];
        }
    }
    return false;
}

/* ---- vertices of degenerate or inverted tetrahedra: contracted only with one at the same point, which moves
 * nothing */

static bool evaluate_frozen(const struct run *run, struct worker *worker, struct waiting *waiting)
{
    const struct working *working = run->working;
    struct star_data *data = &worker->data;
    const double *own = working_row(working, data->vertex);
    double *upper = numbers_of(run, worker, NUMBERS_UPPER), *lower = numbers_of(run, worker, NUMBERS_LOWER);
    for (uint32_t n = 0; n < data->count; n++) {
        const double *row = working_row(working, data->slots[n]);
        bool room;
        if (distance_squared(own, row) != 0 || working->flags[data->slots[n]] & VERTEX_SINGULAR)
            continue;
        for (uint32_t c = 0; c < working->component_count; c++) {
            upper[c] = larger(own[ROW_FIELDS + 2 * c], row[ROW_FIELDS + 2 * c]);
            lower[c] = smaller(own[ROW_FIELDS + 2 * c + 1], row[ROW_FIELDS + 2 * c + 1]);
        }
        struct candidate candidate = {.error = outcome_middles(run, worker, NULL), .neighbour = n};
        bool holds = links_hold(&worker->links, data, working, n, &room);
        worker->failed |= !room;
        if (holds && candidate.error <= run->limit * (1 + LIMIT_TIE)) {
            propose(run, worker, data->vertex, &candidate);
            return true;
        }
        wait_for(waiting, candidate.error, holds);
    }
    return false;
}

void evaluate(const struct run *run, struct worker *worker, uint32_t slot)
{
    const struct working *working = run->working;
    struct proposal *proposal = &run->proposals[slot];
    struct waiting waiting = {INFINITY, INFINITY};
    proposal->priority = PROPOSES_NOTHING;
    proposal->waits = proposal->waits_changed = INFINITY;
    proposal->evaluated = run->round;
    if (run->plans) {
        evaluate_simplices(run, worker, slot);
        return;
    }
    if (working->flags[slot] & (VERTEX_SINGULAR | VERTEX_FIXED))
        return;
    if (!star_data_gather(&worker->data, working, slot) ||
        !ARRAY_RESERVE(worker->candidates, worker->candidate_room, 2 * (size_t)worker->data.count)) {
        worker->failed = true;
        return;
    }
    bool proposed;
    if (working->flags[slot] & VERTEX_FROZEN)
        proposed = evaluate_frozen(run, worker, &waiting);
    else {
        const double *own = working_row(working, slot);
        double *gaps = numbers_of(run, worker, NUMBERS_GAP);
        for (uint32_t c = 0; c < working->component_count; c++)
            gaps[c] = own[ROW_FIELDS + 2 * c] - own[ROW_FIELDS + 2 * c + 1];
        run->kernels->prepare(&worker->data, working);
        uint32_t count = query_edges(run, worker, &waiting);
        proposed = choose(run, worker, slot, count, &waiting);
    }
    if (proposed)
        return;
    double soon = run->limit * (1 + 1e-6); // what is refused within the limit is asked again on the next rung
    proposal->waits = (float)larger(waiting.possible, soon);
    proposal->waits_changed = (float)waiting.any;
}
