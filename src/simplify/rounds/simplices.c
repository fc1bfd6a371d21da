/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * 1. List the simplices of the vertex, with what is known of each.
 * 2. Of those that the limit may have reached, try the candidates: vertices, centre, the quadrics' optimum.
 * 3. Best key first: the link condition and the boundary map; the first that passes is proposed.
 */
#include "src/simplify/rounds/simplices.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"

/* A simplex that a limit was asked about is asked about again after a change where this multiple of what it needed is
 * within the limit. */
static const double EASED = 0.9;

/* Bits of the key that do not count in a priority: quadrics leave fewer tetrahedra where their order is kept. */
enum { FINE_KEYS = 36 };

/* A limit is not asked about a candidate if the quadric expects a root mean square above this multiple of it: of
 * candidates above 1.4 it would refuse about 99 in a hundred. Between the rungs that levels are named after fewer
 * candidates are asked about. */
static const double MAX_EXPECTED = 1, MAX_EXPECTED_NAMED = 1.4;

enum { MAX_CANDIDATES = 6 };

/* A simplex of the vertex, and its bounds: of what is possible, and of what only a change can make so. */
struct listed {
    uint32_t others[3]; /* slots; TETLOD_NONE behind the last */
    struct known known;
    double possible, any;
    bool linked; /* the link condition holds, or was not asked */
};

struct trial {
    double key, error;
    uint32_t listed;
    uint8_t candidate;
    bool passed;
};

struct trials {
    struct listed *listed;
    struct trial *trials;
    uint32_t count, trial_count;
    size_t listed_room, trial_room;
};

struct trials *trials_new(void)
{
    return array_zero(1, sizeof(struct trials));
}

void trials_free(struct trials *trials)
{
    if (trials) {
        free(trials->listed);
        free(trials->trials);
    }
    free(trials);
}

void notes_free(struct notes *notes)
{
    free(notes->known);
    *notes = (struct notes){0};
}

static struct join join_of(const struct working *working, uint32_t slot, const uint32_t others[3])
{
    struct join join = {.simplex = {slot}, .count = 1};
    for (; join.count < 4 && others[join.count - 1] != TETLOD_NONE; join.count++)
        join.simplex[join.count] = others[join.count - 1];
    join.at_one_point = simplex_at_one_point(working, join.simplex, join.count);
    return join;
}

static struct join join_proposed(const struct run *run, uint32_t slot)
{
    return join_of(run->working, slot, run->plans[slot].others);
}

/* ---- 1 */

/* Names of faces and tetrahedra are alike once in 2^32: then one waits for what is known of the other. */
static uint32_t name_of(const struct run *run, const uint32_t others[3])
{
    uint32_t name = run->working->node[others[0]];
    for (int k = 1; k < 3 && others[k] != TETLOD_NONE; k++)
        name = scramble(name) + run->working->node[others[k]];
    return name;
}

static struct known *find_known(const struct notes *notes, uint32_t name)
{
    for (uint32_t i = 0; i < notes->count; i++)
        if (notes->known[i].name == name)
            return &notes->known[i];
    return NULL;
}

/* Adds a simplex, with what is known of it. */
static bool list_simplex(const struct run *run, struct worker *worker, const uint32_t others[3])
{
    struct trials *trials = worker->trials;
    const struct notes *notes = &run->notes[worker->data.vertex];
    bool room = ARRAY_RESERVE(trials->listed, trials->listed_room, trials->count + 1);
    if (!room)
        return false;
    struct listed *listed = &trials->listed[trials->count++];
    *listed = (struct listed){.others = {others[0], others[1], others[2]},
                              .known = {.name = name_of(run, others)},
                              .possible = INFINITY,
                              .any = INFINITY,
                              .linked = true};
    const struct known *known = find_known(notes, listed->known.name);
    if (known)
        listed->known = *known;
    return true;
}

static bool list_edges(const struct run *run, struct worker *worker)
{
    const struct star_data *data = &worker->data;
    bool room = true;
    for (uint32_t n = 0; n < data->count && room; n++)
        if (data->slots[n] > data->vertex)
            room = list_simplex(run, worker, (uint32_t[]){data->slots[n], TETLOD_NONE, TETLOD_NONE});
    return room;
}

/* Does an earlier tetrahedron of the vertex have both neighbours? Then it had the face. */
static bool face_before(const struct star_data *data, uint32_t tet, uint32_t a, uint32_t b)
{
    for (uint32_t i = 0; i < tet; i++) {
        bool has_a = data->corners[0][i] == a || data->corners[1][i] == a || data->corners[2][i] == a;
        if (has_a && (data->corners[0][i] == b || data->corners[1][i] == b || data->corners[2][i] == b))
            return true;
    }
    return false;
}

static bool list_faces(const struct run *run, struct worker *worker)
{
    const struct star_data *data = &worker->data;
    for (uint32_t i = 0; i < data->tet_count; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t a = data->corners[k][i], b = data->corners[(k + 1) % 3][i], x = data->slots[a], y = data->slots[b];
            if (x > data->vertex && y > data->vertex && !face_before(data, i, a, b) &&
                !list_simplex(run, worker, (uint32_t[]){x < y ? x : y, x < y ? y : x, TETLOD_NONE}))
                return false;
        }
    return true;
}

static bool list_tets(const struct run *run, struct worker *worker)
{
    const struct star_data *data = &worker->data;
    for (uint32_t i = 0; i < data->tet_count; i++) {
        uint32_t v[3] = {data->slots[data->corners[0][i]], data->slots[data->corners[1][i]],
                         data->slots[data->corners[2][i]]};
        for (int k = 0; k < 3; k++) { // ascending
            int a = k == 1 ? 1 : 0;
            uint32_t low = v[a] < v[a + 1] ? v[a] : v[a + 1], high = v[a] < v[a + 1] ? v[a + 1] : v[a];
            v[a] = low;
            v[a + 1] = high;
        }
        if (v[0] > data->vertex && !list_simplex(run, worker, v))
            return false;
    }
    return true;
}

/* ---- 2 */

/* Frozen vertices only with vertices at the same point, and not where a limit is asked: that needs interpolants
 * (PROOF.md, 6). */
static bool may_be_contracted(const struct run *run, const struct join *join)
{
    uint8_t flags = 0;
    for (uint32_t s = 0; s < join->count; s++)
        flags |= run->working->flags[join->simplex[s]];
    return !(flags & VERTEX_SINGULAR) && (!(flags & VERTEX_FROZEN) || (join->at_one_point && !run->asked));
}

/* Those of the quadrics' optimum, which is taken inside the domain only, do not matter. */
static void weights_of(const struct join *join, uint32_t candidate, double weights[4])
{
    for (uint32_t s = 0; s < 4; s++)
        weights[s] = candidate == join->count ? 1.0 / join->count : s == candidate;
}

/* The quadrics' optimum inside the domain, near enough to the simplex to be worth a trial. */
static bool optimum(const struct run *run, const struct join *join, double p[3])
{
    const struct working *working = run->working;
    double reach2 = 0, far2 = 0;
    for (uint32_t s = 0; s < join->count; s++)
        if (working->flags[join->simplex[s]] & (VERTEX_BOUNDARY | VERTEX_FIXED))
            return false;
    if (!quadrics_optimum(&run->quadrics, working, join->simplex, join->count, p))
        return false;
    working_round(working, p);
    for (uint32_t s = 0; s < join->count; s++) {
        const double *at = working_row(working, join->simplex[s]);
        far2 = larger(far2, distance_squared(at, p));
        reach2 = larger(reach2, distance_squared(at, working_row(working, join->simplex[0])));
    }
    return far2 < 9 * reach2;
}

bool simplex_position(const struct run *run, const struct join *join, uint32_t candidate, double p[3])
{
    const struct working *working = run->working;
    const double *first = working_row(working, join->simplex[0]);
    if (candidate > join->count)
        return optimum(run, join, p);
    if (candidate < join->count) {
        memcpy(p, working_row(working, join->simplex[candidate]), 3 * sizeof *p);
        return true;
    }
    memcpy(p, first, 3 * sizeof *p);
    for (uint32_t s = 1; s < join->count; s++)
        for (int i = 0; i < 3; i++)
            p[i] += (working_row(working, join->simplex[s])[i] - first[i]) / join->count;
    working_round(working, p);
    return true;
}

static uint32_t removed_of(const struct weighing *weighing)
{
    uint32_t removed = 0;
    for (uint32_t i = 0; i < weighing->count; i++)
        removed += !weighing->moves[i];
    return removed;
}

static double key_of(const struct run *run, double error, double cost, double removed)
{
    switch (run->metric) {
    case METRIC_SVA:
        return error;
    case METRIC_ENVELOPE:
        return error / (removed * sqrt(removed));
    default:
        return cost / (removed * removed);
    }
}

enum tried { FORBIDDEN, FLIPPED, FITS };

/* What a limit is expected to need at join->p. The star is looked at only where that may be within the limit. */
static enum tried try_estimate(const struct run *run, struct worker *worker, const struct join *join, double *error,
                               double *key)
{
    struct star *star = &worker->star;
    double cost;
    *error = outcome_estimate(run, join, &cost) / (run->named ? MAX_EXPECTED_NAMED : MAX_EXPECTED);
    if (*error > run->limit * (1 + LIMIT_TIE))
        return FITS;
    if (!star->simplex_count && !star_gather(star, run->working, join->simplex, join->count)) {
        worker->failed = true;
        return FLIPPED;
    }
    bool fits = star_fits(star, run->working, join->p);
    worker->refused[LOG_REFUSED_FLIP] += !fits;
    *key = key_of(run, *error, cost, star->removed_count);
    return fits ? FITS : FLIPPED;
}

/* Tries a candidate of a listed simplex, whose star the worker has: its error, or what a limit is expected to need, and
 * its key. */
static enum tried try_candidate(const struct run *run, struct worker *worker, struct join *join, uint32_t candidate,
                                double *error,
                                double *key)
{
    double cost = 0, weights[4];
    weights_of(join, candidate, weights);
    if (!simplex_position(run, join, candidate, join->p) ||
        (!join->at_one_point &&
         !border_allows(&run->border, run->working, join->simplex, join->count, weights, join->p)))
        return FORBIDDEN;
    if (run->asked)
        return try_estimate(run, worker, join, error, key);
    bool fits = outcome_weigh(run, worker, join);
    worker->refused[LOG_REFUSED_FLIP] += !fits;
    if (run->metric == METRIC_SVA)
        outcome_say(run, worker, join, true);
    else
        outcome_bounds(run, worker, join);
    *error = outcome_values(run, worker, join, NULL, &cost);
    *key = key_of(run, *error, cost, removed_of(&worker->weighing));
    return fits ? FITS : FLIPPED;
}

static void wait_for(struct listed *listed, double error, bool possible)
{
    listed->any = smaller(listed->any, error);
    if (possible)
        listed->possible = smaller(listed->possible, error);
}

static bool changed_since(const struct run *run, const struct join *join, uint32_t round)
{
    for (uint32_t s = 0; s < join->count; s++)
        if (run->proposals[join->simplex[s]].changed > round)
            return true;
    return false;
}

/* Does what is known say that the limit is still too low for the simplex? */
static bool still_waits(const struct run *run, struct listed *listed, const struct join *join)
{
    const struct known *known = &listed->known;
    double limit = run->limit * (1 + 1e-6); // bounds are stored as float
    if (!known->round)
        return false;
    bool changed = changed_since(run, join, known->round);
    double bound = changed ? (known->asked ? EASED * known->bound : 0) : known->bound;
    if (bound <= limit && (changed || known->possible))
        return false;
    wait_for(listed, bound, changed || known->possible);
    return true;
}

static bool try_simplex(const struct run *run, struct worker *worker, uint32_t number)
{
    struct trials *trials = worker->trials;
    struct listed *listed = &trials->listed[number];
    struct join join = join_of(run->working, worker->data.vertex, listed->others);
    double limit = run->limit * (1 + LIMIT_TIE), error, key = 0;
    if (!may_be_contracted(run, &join)) {
        wait_for(listed, 0, false); // until that changes
        return true;
    }
    if (still_waits(run, listed, &join))
        return true;
    listed->known.round = run->round;
    listed->known.possible = listed->known.asked = 0;
    listed->known.bound = INFINITY;
    bool room = ARRAY_RESERVE(trials->trials, trials->trial_room, trials->trial_count + MAX_CANDIDATES);
    worker->star.simplex_count = 0; // it is gathered when it is needed
    if (!room || (!run->asked && !outcome_list(run, worker, &join)))
        return false;
    for (uint32_t c = 0; c < simplex_candidates(run, join.count); c++) {
        enum tried tried = try_candidate(run, worker, &join, c, &error, &key);
        if (tried == FORBIDDEN)
            continue;
        if (error <= limit && tried == FITS)
            trials->trials[trials->trial_count++] = (struct trial){key, error, number, (uint8_t)c, false};
        else
            wait_for(listed, error, tried == FITS);
    }
    return true;
}

/* ---- 3 */

static bool link_holds(const struct run *run, struct worker *worker, const struct join *join)
{
    bool room = true, holds;
    if (join->count == 2)
        holds = links_hold(&worker->links, &worker->data, run->working,
                           star_data_number_or(&worker->data, join->simplex[1], TETLOD_NONE),
                           &room);
    else {
        room = star_gather(&worker->star, run->working, join->simplex, join->count);
        holds = room && links_hold_star(&worker->links, &worker->star, run->working, &room);
    }
    worker->failed |= !room;
    worker->refused[LOG_REFUSED_LINK] += !holds;
    return holds;
}

static bool is_open(const struct run *run, const struct join *join)
{
    bool open = false;
    for (uint32_t s = 0; s < join->count; s++)
        open |= run->working->flags[join->simplex[s]] & VERTEX_BOUNDARY;
    return open;
}

/* Asks the boundary. False: it forbids it; else the trial's error is what it demands, too. */
static bool boundary_agrees(const struct run *run, struct worker *worker, struct join *join, struct trial *trial)
{
    simplex_position(run, join, trial->candidate, join->p);
    if (!is_open(run, join))
        return true;
    if (isinf(border_moves(&run->border, run->working, join->simplex, join->count, join->p, &worker->map))) {
        worker->refused[LOG_REFUSED_BOUNDARY]++;
        return false;
    }
    if (run->asked || run->metric == METRIC_SVA)
        return true;
    if (!outcome_list(run, worker, join) || !outcome_weigh(run, worker, join))
        return false;
    outcome_bounds(run, worker, join);
    outcome_demands(run, worker);
    double cost = 0, error = outcome_values(run, worker, join, NULL, &cost);
    trial->error = larger(trial->error, error);
    trial->key = key_of(run, trial->error, cost, removed_of(&worker->weighing));
    return true;
}

/* The best trial that passes, or NULL. */
static const struct trial *choose(const struct run *run, struct worker *worker)
{
    struct trials *trials = worker->trials;
    double limit = run->limit * (1 + LIMIT_TIE);
    while (trials->trial_count) {
        struct trial *best = trials->trials;
        for (uint32_t i = 1; i < trials->trial_count; i++)
            best = trials->trials[i].key < best->key ? &trials->trials[i] : best;
        if (best->passed)
            return best;
        struct listed *listed = &trials->listed[best->listed];
        struct join join = join_of(run->working, worker->data.vertex, listed->others);
        listed->linked = listed->linked && link_holds(run, worker, &join);
        bool possible = listed->linked && boundary_agrees(run, worker, &join, best);
        best->passed = possible && best->error <= limit;
        if (!best->passed) {
            wait_for(listed, best->error, possible);
            *best = trials->trials[--trials->trial_count];
        }
    }
    return NULL;
}

/* Keeps what is known of the simplices. False: no memory. */
static bool keep_notes(const struct run *run, struct worker *worker)
{
    struct trials *trials = worker->trials;
    struct notes *notes = &run->notes[worker->data.vertex];
    if (trials->count != notes->count) {
        void *known = array_resize(notes->known, trials->count, sizeof *notes->known);
        if (!known)
            return false;
        notes->known = known;
        notes->count = trials->count;
    }
    for (uint32_t i = 0; i < trials->trial_count; i++) // within the limit: to be tried again
        wait_for(&trials->listed[trials->trials[i].listed], trials->trials[i].error, true);
    for (uint32_t i = 0; i < trials->count; i++) {
        struct listed *listed = &trials->listed[i];
        if (listed->known.round == run->round && !listed->known.asked) {
            listed->known.possible = isfinite(listed->possible);
            listed->known.bound = (float)(isfinite(listed->possible) ? listed->possible : listed->any);
        }
        notes->known[i] = listed->known;
    }
    return true;
}

static void propose(const struct run *run, struct worker *worker, const struct trial *trial)
{
    struct plan *plan = &run->plans[worker->data.vertex];
    memcpy(plan->others, worker->trials->listed[trial->listed].others, sizeof plan->others);
    plan->candidate = trial->candidate;
    run->proposals[worker->data.vertex].priority = priority_of(trial->key, worker->data.vertex, FINE_KEYS);
}

void evaluate_simplices(const struct run *run, struct worker *worker, uint32_t slot)
{
    struct proposal *proposal = &run->proposals[slot];
    struct trials *trials = worker->trials;
    double possible = INFINITY, any = INFINITY;
    trials->count = trials->trial_count = 0;
    bool room = run->working->flags[slot] & VERTEX_SINGULAR || star_data_gather(&worker->data, run->working, slot);
    if (!room || run->working->flags[slot] & VERTEX_SINGULAR) {
        worker->failed |= !room;
        return;
    }
    room = (!(run->contract & CONTRACT_EDGES) || list_edges(run, worker)) && (!(run->contract & CONTRACT_FACES) ||
                                                                              list_faces(run, worker)) &&
           (!(run->contract & CONTRACT_TETS) || list_tets(run, worker));
    for (uint32_t i = 0; i < trials->count && room; i++)
        room = try_simplex(run, worker, i);
    const struct trial *best = room ? choose(run, worker) : NULL;
    if (!room || !keep_notes(run, worker)) {
        worker->failed = true;
        return;
    }
    if (best) {
        propose(run, worker, best);
        return;
    }
    for (uint32_t i = 0; i < trials->count; i++) {
        possible = smaller(possible, trials->listed[i].possible);
        any = smaller(any, trials->listed[i].any);
    }
    // what is refused within the limit is asked again on the next rung
    proposal->waits = (float)larger(possible, run->limit * (1 + 1e-6));
    proposal->waits_changed = (float)any;
}

bool simplices_changed(const struct run *run, uint32_t slot)
{
    const struct working *working = run->working;
    const struct span *star = &working->stars[slot];
    uint32_t evaluated = run->proposals[slot].evaluated;
    for (uint32_t i = 0; i < star->count; i++) {
        const uint32_t *corners = working->corners[working->pool[star->begin + i]];
        for (int c = 0; c < 4 && corners[0] != TETLOD_NONE; c++)
            if (corners[c] >= slot && run->proposals[corners[c]].changed > evaluated)
                return true;
    }
    return false;
}

/* ---- a limit that is asked */

enum tetlod_status simplex_ask(const struct run *run, struct worker *worker, unsigned number, uint32_t slot,
                               struct answer *answer, struct tetlod_error *error)
{
    struct join join = join_proposed(run, slot);
    double positions[MAX_CANDIDATES][3], keys[MAX_CANDIDATES], limit = run->limit * (1 + LIMIT_TIE), least = INFINITY,
                                                               expected, key = 0;
    uint32_t count = 0;
    if (!star_gather(&worker->star, run->working, join.simplex, join.count)) {
        worker->failed = true;
        return TETLOD_OK;
    }
    for (uint32_t c = 0; c < simplex_candidates(run, join.count); c++) {
        if (try_candidate(run, worker, &join, c, &expected, &key) != FITS)
            continue;
        if (expected > limit) {
            least = smaller(least, expected);
            continue;
        }
        if (is_open(run, &join) &&
            isinf(border_moves(&run->border, run->working, join.simplex, join.count, join.p, &worker->map)))
            continue;
        uint32_t at = count++;
        for (; at > 0 && keys[at - 1] > key; at--) {
            keys[at] = keys[at - 1];
            memcpy(positions[at], positions[at - 1], sizeof *positions);
        }
        keys[at] = key;
        memcpy(positions[at], join.p, sizeof *positions);
    }
    const struct question question = {run->working, &run->border, &worker->star, (const double(*)[3])positions, count,
                                      run->limit, run->named};
    TETLOD_TRY(run->asked->ask(run->asked->state, number, &question, answer, error));
    worker->refused[LOG_REFUSED_SIZE] += answer->too_large;
    if (!answer->allowed)
        answer->error = smaller(answer->error, least);
    return TETLOD_OK;
}

void simplex_refused(const struct run *run, uint32_t slot, double error)
{
    struct known *known = find_known(&run->notes[slot], name_of(run, run->plans[slot].others));
    run->proposals[slot].priority = PROPOSES_NOTHING;
    if (known) {
        known->bound = nextafterf((float)larger(error, run->limit * (1 + 1e-6)), INFINITY);
        known->possible = known->asked = 1;
        known->round = run->round;
    }
}
