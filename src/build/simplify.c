/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/build/simplify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/build/exact.h"
#include "src/build/entry.h"
#include "src/build/ladder.h"
#include "src/build/samples.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/parallel.h"

/* Trials are followed to this multiple of the limit, so that most of what waits is not looked at on the next rungs. */
static const double HORIZON = 2;

/* The same of the exact limit, which is dear to ask. */
static const double EXACT_HORIZON = 1.1;

/* Above this multiple of the limit, the root mean square that the quadric expects tells that the exact limit will refuse (hardly
 * one in a hundred that it allows has more than 1.4): it waits unasked. Less is asked between the rungs that levels are
 * named after. */
static const double CHANCE = 1, CHANCE_NAMED = 1.4;

/* What a contraction may be above the limit by the rounding of its bounds: it still counts as the limit. Exact ties with
 * round limits are common in regular meshes. */
static const double ROUNDING = 1e-9;

/* What evaluating a simplex needs: one a thread. */
struct judge {
    struct star star;
    struct metric_scratch scratch;
    struct examiner examiner; /* of the exact limit */
    struct sampler sampler; /* of the measured metric */
    struct shift shift;
    struct tetlod_error error;
    enum tetlod_status status;
};

/* A simplex whose turn has come under the exact limit. */
struct work {
    struct queue_entry entry;
    enum { FILED, REFUSED, ALLOWED } outcome; /* it has a key; it waits; it may be contracted, as far as the error goes */
    double *values, *errors;                  /* [driver_count] */
    struct sentinel witnesses[8];             /* points that refused candidates */
    uint32_t witness_count;
};

/* So many are examined at a time, on as many threads as there are. */
enum { BATCH = 32 };

struct run {
    const struct simplify_options *options;
    struct simplification *out;
    struct complex *complex;
    struct fields *fields;
    struct boundary boundary;
    struct overlaps overlaps; /* of the exact limit */
    struct samples samples; /* of the measured metric */
    struct judge *judges; /* [judge_count]; the first is the one that contracts */
    unsigned judge_count;
    struct queue queue, waiting;
    struct queue_entry last;    /* that was listed after a contraction */
    struct queue fresh;         /* of the exact limit: simplices that are not evaluated yet */
    struct work *works;         /* [BATCH] */
    double batch_key;           /* the least in the queue behind the batch */
    double *work_values;        /* [BATCH][2][driver_count] values and errors */
    double limit;               /* of the current rung */
    double moved;               /* running maximum of how far the boundary moved */
    double chance;              /* what the estimate of an error may be above it to have a chance under the exact limit */
    double *certified, *predicted; /* [driver_count] running maxima */
    double *assigned;              /* [driver_count] of the contraction at hand, as is its outcome */
    struct outcome *outcome;
    uint32_t *link, *thawed;
    size_t link_capacity, thawed_capacity;
    struct tetlod_error *error;
};

static bool is_exact(const struct run *run)
{
    return run->options->certify == CERTIFY_EXACT;
}

/* The metric's own optimum for a simplex inside the domain, near enough to it to be worth a trial. It is tried behind the
 * candidates. */
static bool optimum_position(const struct run *run, const struct star *star, double p[3])
{
    const struct complex *complex = run->complex;
    double reach2 = 0, far2 = 0;
    if (!metric_has_quadrics(run->options->metric))
        return false;
    for (uint32_t s = 0; s < star->simplex_count; s++)
        if (complex->flags[star->simplex[s]] & VERTEX_BOUNDARY)
            return false;
    if (!metric_optimum(run->fields, star, p))
        return false;
    complex_round_position(complex, p);
    for (uint32_t s = 0; s < star->simplex_count; s++) {
        const double *at = complex->positions + 3 * (size_t)star->simplex[s];
        far2 = larger(far2, distance_squared(at, p));
        reach2 = larger(reach2, distance_squared(at, complex->positions + 3 * (size_t)star->simplex[0]));
    }
    return far2 < 9 * reach2;
}

/* Trials are followed up to here. */
static double horizon(const struct run *run)
{
    return is_exact(run) ? INFINITY : HORIZON * run->limit;
}

/* Errors of trials on the judge's star. */
static enum tetlod_status try_all(const struct run *run, struct judge *judge, const struct shift *shift, double most,
                                  struct trial *trials, uint32_t count)
{
    if (run->options->metric == METRIC_MEASURED)
        return samples_try(&run->samples, &judge->sampler, run->complex, run->fields, &judge->star, run->limit, most,
                           trials, count, &judge->error);
    metric_try(run->options->metric, &judge->scratch, run->fields, run->complex, &judge->star, shift, most, trials, count);
    return TETLOD_OK;
}

/* The values that they have assigned to the drivers at the first of them. */
static void take_assigned(const struct run *run, const struct judge *judge, double *values)
{
    if (run->options->metric == METRIC_MEASURED)
        samples_assigned(&judge->sampler, run->fields, 0, values);
    else
        metric_assigned(&judge->scratch, run->fields, 0, values);
}

/* Lets the boundary have its say on a trial that the fields allow: it may forbid it, or demand more of the values. */
static void ask_boundary(const struct run *run, struct judge *judge, struct queue_entry *entry, struct trial *trial,
                         uint32_t number)
{
    double before = trial->error;
    double moved = boundary_moves(&run->boundary, run->complex, &judge->star, trial->position, &judge->shift);
    if (!(moved <= run->boundary.limit))
        trial->error = INFINITY;
    else if (metric_is_certified(run->options->metric) && !is_exact(run))
        metric_demand(&judge->scratch, run->fields, &judge->shift, number, &trial->error);
    if (trial->error > before)
        entry->witness_count = QUEUE_WITNESSES + 1;
}

/* Tries all candidates on the judge's star. Returns how many there are. */
static enum tetlod_status try_candidates(const struct run *run, struct judge *judge, struct trial *trials,
                                         uint32_t *out_count)
{
    uint32_t vertices = judge->star.simplex_count, count = candidates_count(vertices, run->options->candidates);
    for (uint32_t c = 0; c < count; c++) {
        candidate_position(run->complex, &judge->star, c, trials[c].position);
        trials[c].possible = boundary_allows(&run->boundary, run->complex, &judge->star, candidates_weights(vertices, c),
                                             trials[c].position);
    }
    trials[count].possible = optimum_position(run, &judge->star, trials[count].position);
    *out_count = count += trials[count].possible;
    return try_all(run, judge, NULL, horizon(run), trials, count);
}

/* The best of the candidates that were tried on the judge's star: its error is returned (INFINITY: none is possible; above the limit:
 * a lower bound), its key is in entry->value. */
static double best_trial(const struct run *run, struct judge *judge, struct queue_entry *entry, struct trial *trials,
                         uint32_t count)
{
    double best = INFINITY, least = INFINITY;
    for (uint32_t c = 0; c < count; c++) {
        if (entry->refused & UINT32_C(1) << c)
            continue;
        remember_witnesses(entry, trials[c].witness);
        if (!trials[c].possible) {
            entry->refused |= UINT32_C(1) << c;
            continue;
        }
        if (is_exact(run)) // it is asked only when the candidate's turn comes, if that has a chance
            trials[c].error = metric_has_quadrics(run->options->metric) ? trials[c].error / run->chance : 0;
        if (trials[c].error <= run->limit)
            ask_boundary(run, judge, entry, &trials[c], c);
        least = smaller(least, trials[c].error);
        double key = metric_key(run->options->metric, &trials[c], judge->star.removed_count);
        if (trials[c].error <= run->limit && key < best) {
            best = key;
            entry->candidate = c;
        }
    }
    entry->value = best;
    return least;
}

/* The best candidate of the judge's star, as best_trial has it. */
static enum tetlod_status best_candidate(const struct run *run, struct judge *judge, struct queue_entry *entry,
                                         double *out_error)
{
    struct trial trials[MOST_TRIALS];
    uint32_t count;
    TETLOD_TRY(try_candidates(run, judge, trials, &count));
    *out_error = best_trial(run, judge, entry, trials, count);
    return TETLOD_OK;
}

/* Is the simplex refused beyond the horizon by tetrahedra alone that have refused it, or its like, before? Most that waits is, and its
 * star need not be gathered. Then the entry's value is a lower bound of its error. */
static enum tetlod_status refused_by(const struct run *run, struct judge *judge, struct queue_entry *entry,
                                     const uint32_t *tets, uint32_t tet_count, bool *out_refused)
{
    struct trial trials[MOST_TRIALS];
    uint32_t count;
    *out_refused = false;
    TETLOD_TRY(star_gather_some(&judge->star, run->complex, entry->vertices, vertex_count(entry), tets, tet_count,
                                &judge->error));
    if (!judge->star.tet_count || judge->star.still)
        return TETLOD_OK;
    TETLOD_TRY(try_candidates(run, judge, trials, &count));
    for (uint32_t c = 0; c < count; c++)
        if (trials[c].possible && !(trials[c].error > horizon(run)))
            return TETLOD_OK;
    entry->value = best_trial(run, judge, entry, trials, count);
    *out_refused = true;
    return TETLOD_OK;
}

/* Frozen vertices only with vertices at the same point, under the envelope: that needs no interpolant (PROOF.md, 6). */
static bool contractible(const struct run *run, const struct queue_entry *entry)
{
    const struct complex *complex = run->complex;
    const double *first = complex->positions + 3 * (size_t)entry->vertices[0];
    bool still = run->options->metric != METRIC_MEASURED && !is_exact(run), frozen = false;
    for (uint32_t i = 0; i < vertex_count(entry); i++) {
        if (complex->flags[entry->vertices[i]] & VERTEX_SINGULAR)
            return false;
        frozen |= complex->flags[entry->vertices[i]] & VERTEX_FROZEN;
        still &= distance_squared(first, complex->positions + 3 * (size_t)entry->vertices[i]) == 0;
    }
    return still || !frozen;
}

/* Evaluates a simplex as it is now. *out_allowed: the limit allows it, and entry->value is its key; else it is a lower bound
 * of its error. Changes nothing but the judge. */
static enum tetlod_status evaluate(const struct run *run, struct judge *judge, struct queue_entry *entry,
                                   bool *out_allowed)
{
    double error;
    uint32_t known = entry->witness_count <= QUEUE_WITNESSES ? entry->witness_count : 0, tets[QUEUE_WITNESSES];
    bool refused = false;
    memcpy(tets, entry->witness, known * sizeof *tets);
    entry->stamp = run->complex->contraction_count;
    entry->witness_count = entry->refused = 0;
    entry->bound = INFINITY;
    *out_allowed = false;
    if (known && run->options->metric != METRIC_MEASURED && !is_exact(run))
        TETLOD_TRY(refused_by(run, judge, entry, tets, known, &refused));
    if (refused)
        return TETLOD_OK;
    TETLOD_TRY(star_gather(&judge->star, run->complex, entry->vertices, vertex_count(entry), &judge->error));
    TETLOD_TRY(best_candidate(run, judge, entry, &error));
    *out_allowed = error <= run->limit;
    entry->value = *out_allowed ? entry->value : error;
    return TETLOD_OK;
}

/* Into the queue, or with those that wait for a higher rung. */
static enum tetlod_status file(struct run *run, const struct queue_entry *entry, bool allowed)
{
    if (allowed ? queue_push(&run->queue, entry) : queue_append(&run->waiting, entry))
        return TETLOD_OK;
    return tetlodi_fail_nomem(run->error, "the queue", run->queue.capacity * sizeof *entry);
}

static enum tetlod_status evaluate_and_file(struct run *run, struct queue_entry *entry)
{
    bool allowed;
    if (!contractible(run, entry))
        return TETLOD_OK;
    if (evaluate(run, run->judges, entry, &allowed) != TETLOD_OK) {
        *run->error = run->judges->error;
        return run->judges->error.status;
    }
    return file(run, entry, allowed);
}

/* ---- which simplices there are */

/* Files the simplex of v and up to three more vertices: at first with those that wait, later evaluated. Of the first listing
 * each simplex is filed by its least vertex. */
static enum tetlod_status file_simplex(struct run *run, uint32_t v, const uint32_t *others, int count, bool first)
{
    struct queue_entry entry = {.vertices = {v, TETLOD_NONE, TETLOD_NONE, TETLOD_NONE}};
    for (int i = 0; i < count; i++) {
        int at = i + 1;
        for (; at > 0 && entry.vertices[at - 1] > others[i]; at--)
            entry.vertices[at] = entry.vertices[at - 1];
        entry.vertices[at] = others[i];
    }
    if (!first && !is_exact(run)) { // what refused the last one, if it is at v, may refuse this one
        entry.witness_count = run->last.witness_count;
        memcpy(entry.witness, run->last.witness, sizeof entry.witness);
        TETLOD_TRY(evaluate_and_file(run, &entry));
        run->last = entry;
        return TETLOD_OK;
    }
    if (!first && contractible(run, &entry) && !queue_append(&run->fresh, &entry))
        return tetlodi_fail_nomem(run->error, "the queue", run->fresh.capacity * sizeof entry);
    return first && entry.vertices[0] == v && contractible(run, &entry) ? file(run, &entry, false) : TETLOD_OK;
}

static enum tetlod_status list_edges(struct run *run, uint32_t v, bool first)
{
    size_t count = 0;
    TETLOD_TRY(complex_link_vertices(run->complex, v, &run->link, &run->link_capacity, &count, run->error));
    for (size_t i = 0; i < count; i++)
        TETLOD_TRY(file_simplex(run, v, &run->link[i], 1, first));
    return TETLOD_OK;
}

/* Faces and tetrahedra by the tetrahedra of the star; a face by the first of its two. */
static enum tetlod_status list_larger(struct run *run, uint32_t v, bool first)
{
    const struct complex *complex = run->complex;
    for (uint32_t i = 0; i < complex->star_count[v]; i++) {
        uint32_t tet = complex->pool[complex->star_begin[v] + i], others[3], opposite[3];
        int count = 0;
        for (uint32_t c = 0; c < 4; c++)
            if (complex->corners[4 * (size_t)tet + c] != v) {
                opposite[count] = complex->neighbours[4 * (size_t)tet + c];
                others[count++] = complex->corners[4 * (size_t)tet + c];
            }
        for (int k = 0; k < 3 && run->options->contract & CONTRACT_FACES; k++) {
            uint32_t pair[2] = {others[(k + 1) % 3], others[(k + 2) % 3]};
            if (opposite[k] == TETLOD_NONE || opposite[k] / 4 > tet)
                TETLOD_TRY(file_simplex(run, v, pair, 2, first));
        }
        if (run->options->contract & CONTRACT_TETS)
            TETLOD_TRY(file_simplex(run, v, others, 3, first));
    }
    return TETLOD_OK;
}

static enum tetlod_status list_simplices(struct run *run, uint32_t v, bool first)
{
    if (run->options->contract & CONTRACT_EDGES)
        TETLOD_TRY(list_edges(run, v, first));
    if (run->options->contract & ~CONTRACT_EDGES)
        TETLOD_TRY(list_larger(run, v, first));
    return TETLOD_OK;
}

/* After a contraction at one point: lists the simplices of the vertices around it that are free now. */
static enum tetlod_status thaw(struct run *run, uint32_t v)
{
    size_t count = 0;
    TETLOD_TRY(complex_link_vertices(run->complex, v, &run->thawed, &run->thawed_capacity, &count, run->error));
    complex_thaw(run->complex, v);
    for (size_t i = 0; i < count; i++)
        if (complex_thaw(run->complex, run->thawed[i]))
            TETLOD_TRY(list_simplices(run, run->thawed[i], false));
    return TETLOD_OK;
}

/* Puts an entry that a late check refuses among the waiting: until its star changes, or the limit reaches `error`. */
static enum tetlod_status refuse(struct run *run, struct queue_entry entry, double error)
{
    entry.value = error;
    entry.witness_count = QUEUE_WITNESSES + 1;
    return file(run, &entry, false);
}

/* The limit as a driver's own error, for errors that are above it by rounding only; else no limit. */
static double rounded_limit(const struct run *run, const struct driver *driver)
{
    return metric_is_certified(run->options->metric) ? run->limit / driver->weight : INFINITY;
}

/* Where the entry's candidate is, and how far the boundary then has moved in all, by judge->shift. False: it cannot be had. */
static bool find_place(const struct run *run, struct judge *judge, const struct queue_entry *entry, double p[3],
                       double *moved)
{
    const struct star *star = &judge->star;
    if (entry->candidate < candidates_count(star->simplex_count, run->options->candidates))
        candidate_position(run->complex, star, entry->candidate, p);
    else if (!optimum_position(run, star, p))
        return false;
    *moved = boundary_moves(&run->boundary, run->complex, star, p, &judge->shift);
    return *moved <= run->boundary.limit && star_fits(star, run->complex, p);
}

/* Contracts what all checks have accepted; `errors` are what the drivers' are certified to be. */
static enum tetlod_status perform(struct run *run, const struct star *star, const double p[3], double moved,
                                  const double *errors)
{
    uint32_t v = star->simplex[0];
    fields_contract(run->fields, run->complex, star, p, run->outcome);
    TETLOD_TRY(complex_contract(run->complex, star, p, run->error));
    metric_update_envelopes(run->options->metric, run->fields, run->complex, v);
    boundary_update(&run->boundary, run->complex, v, moved);
    run->moved = larger(run->moved, moved);
    for (uint32_t d = 0; d < run->fields->driver_count; d++) {
        const struct driver *driver = &run->fields->drivers[d];
        double certain = smaller(errors[d] * driver->scale, rounded_limit(run, driver));
        run->certified[d] = larger(run->certified[d], smaller(certain, 1)); // values never leave the range
        run->predicted[d] = fmax(run->predicted[d], driver->predicted[v] * driver->scale);
    }
    if (star->still)
        TETLOD_TRY(thaw(run, v));
    return list_simplices(run, v, false);
}

/* Does a fresh entry, unless a check that is made only now refuses it. */
static enum tetlod_status contract(struct run *run, const struct queue_entry *entry)
{
    double p[3], moved;
    bool holds;
    struct judge *judge = run->judges;
    struct star *star = &judge->star;
    TETLOD_TRY(star_gather(star, run->complex, entry->vertices, vertex_count(entry), run->error));
    if (!find_place(run, judge, entry, p, &moved))
        return refuse(run, *entry, INFINITY);
    TETLOD_TRY(star_link_condition(star, run->complex, &holds, run->error));
    if (!holds)
        return refuse(run, *entry, INFINITY);
    struct trial trial = {.position = {p[0], p[1], p[2]}, .possible = true};
    if (try_all(run, judge, &judge->shift, run->limit, &trial, 1) != TETLOD_OK) {
        *run->error = judge->error;
        return run->error->status;
    }
    if (run->options->metric == METRIC_MEASURED && (!trial.possible || trial.error > run->limit))
        return refuse(run, *entry, trial.possible ? trial.error : INFINITY);
    take_assigned(run, judge, run->assigned);
    fields_outcome(run->fields, run->complex, star, &judge->shift, p, run->assigned, run->outcome);
    double certified = outcome_error(run->fields, run->outcome);
    if (metric_is_certified(run->options->metric) && certified > run->limit * (1 + ROUNDING)) // its rounding is too much
        return refuse(run, *entry, certified);
    if (run->options->metric == METRIC_MEASURED)
        samples_contract(&run->samples, &judge->sampler, run->fields, star, trial.error);
    for (uint32_t d = 0; d < run->fields->driver_count; d++)
        run->assigned[d] = larger(run->outcome[d].upper - run->outcome[d].value,
                                  run->outcome[d].value - run->outcome[d].lower);
    return perform(run, star, p, moved, run->assigned);
}

/* ---- the exact limit */

/* The values that the metric would give the drivers at p. */
static enum tetlod_status find_values(const struct run *run, struct judge *judge, const double p[3], double *values)
{
    struct trial trial = {.position = {p[0], p[1], p[2]}, .possible = true};
    TETLOD_TRY(try_all(run, judge, &judge->shift, INFINITY, &trial, 1));
    take_assigned(run, judge, values);
    return TETLOD_OK;
}

/* The entry's candidate is refused; its next best is chosen. *out_left: there is one. */
static enum tetlod_status next_candidate(const struct run *run, struct judge *judge, struct queue_entry *entry,
                                         const struct finding *finding, bool *out_left)
{
    double estimate;
    uint32_t a = finding->witness[0].tet, b = finding->witness[1].tet;
    entry->refused |= UINT32_C(1) << entry->candidate;
    entry->bound = smaller(entry->bound, finding->error);
    remember_witnesses(entry, (uint32_t[]){a == TETLOD_NONE ? b : a, b == TETLOD_NONE ? a : b});
    TETLOD_TRY(best_candidate(run, judge, entry, &estimate));
    entry->bound = smaller(entry->bound, estimate);
    *out_left = isfinite(entry->value);
    return TETLOD_OK;
}

/* Examines a fresh entry's candidates, best first, until one is allowed or it is not its turn any more. Changes nothing but the judge and the work. */
static enum tetlod_status examine(const struct run *run, struct judge *judge, struct work *work)
{
    struct queue_entry *entry = &work->entry;
    bool taken_up = false;
    work->witness_count = 0;
    TETLOD_TRY(star_gather(&judge->star, run->complex, entry->vertices, vertex_count(entry), &judge->error));
    do {
        struct finding finding = {.error = INFINITY, .witness = {{.tet = TETLOD_NONE}, {.tet = TETLOD_NONE}}};
        double p[3], moved;
        bool left;
        if (find_place(run, judge, entry, p, &moved)) {
            TETLOD_TRY(find_values(run, judge, p, work->values));
            if (!taken_up)
                TETLOD_TRY(exact_take_up(&judge->examiner, run->complex, run->fields, &judge->star, &judge->error));
            taken_up = true;
            TETLOD_TRY(exact_examine(&judge->examiner, &run->overlaps, run->complex, run->fields, &judge->star, p,
                                     work->values, run->limit, EXACT_HORIZON * run->limit, &finding, &judge->error));
        } else
            entry->witness_count = QUEUE_WITNESSES + 1;
        if (finding.allowed) {
            memcpy(work->values, judge->examiner.chosen, run->fields->driver_count * sizeof(double));
            memcpy(work->errors, judge->examiner.errors, run->fields->driver_count * sizeof(double));
            work->outcome = ALLOWED;
            return TETLOD_OK;
        }
        work->outcome = REFUSED;
        for (int i = 0; i < 2 && work->witness_count < 8; i++)
            work->witnesses[work->witness_count++] = finding.witness[i];
        TETLOD_TRY(next_candidate(run, judge, entry, &finding, &left));
        if (!left) {
            entry->value = entry->bound;
            return TETLOD_OK;
        }
    } while (entry->value <= run->batch_key);
    work->outcome = FILED; // others come before its next candidate
    return TETLOD_OK;
}

static void work_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct run *run = context;
    struct judge *judge = &run->judges[worker];
    for (size_t i = begin; i < end && judge->status == TETLOD_OK; i++) {
        struct work *work = &run->works[i];
        bool allowed;
        if (!stale(run->complex, &work->entry)) {
            judge->status = examine(run, judge, work);
            continue;
        }
        work->witness_count = 0;
        judge->status = evaluate(run, judge, &work->entry, &allowed);
        work->outcome = allowed ? FILED : REFUSED;
    }
}

/* Contracts an entry that was allowed, if nothing else of its batch is in the way. */
static enum tetlod_status contract_exactly(struct run *run, const struct work *work)
{
    double p[3], moved;
    bool holds;
    struct star *star = &run->judges->star;
    const struct queue_entry *entry = &work->entry;
    if (obsolete(run->complex, entry))
        return TETLOD_OK;
    if (stale(run->complex, entry))
        return file(run, entry, true);
    TETLOD_TRY(star_gather(star, run->complex, entry->vertices, vertex_count(entry), run->error));
    TETLOD_TRY(star_link_condition(star, run->complex, &holds, run->error));
    if (!holds || !find_place(run, run->judges, entry, p, &moved))
        return refuse(run, *entry, INFINITY);
    fields_outcome(run->fields, run->complex, star, &run->judges->shift, p, work->values, run->outcome);
    TETLOD_TRY(exact_contract(&run->judges->examiner, &run->overlaps, run->complex, star, p, run->error));
    return perform(run, star, p, moved, work->errors);
}

static enum tetlod_status first_failure(struct run *run)
{
    for (unsigned j = 0; j < run->judge_count; j++)
        if (run->judges[j].status != TETLOD_OK) {
            *run->error = run->judges[j].error;
            return run->judges[j].status;
        }
    return TETLOD_OK;
}

/* ---- marks and rungs */

static enum tetlod_status mark(struct run *run)
{
    struct simplification *out = run->out;
    size_t count = out->mark_count, drivers = run->fields->driver_count;
    struct mark now = {run->complex->contraction_count, run->complex->vertices_alive, run->complex->tets_alive,
                       run->moved};
    if (count && out->marks[count - 1].contractions == now.contractions)
        return TETLOD_OK;
    void *marks = out->marks, *certified = out->mark_certified, *predicted = out->mark_predicted;
    bool room = array_reserve(&marks, &out->mark_capacity, count + 1, sizeof now);
    out->marks = marks;
    room = room && array_reserve(&certified, &out->certified_capacity, (count + 1) * drivers, sizeof(double));
    out->mark_certified = certified;
    room = room && array_reserve(&predicted, &out->predicted_capacity, (count + 1) * drivers, sizeof(double));
    out->mark_predicted = predicted;
    if (!room)
        return tetlodi_fail_nomem(run->error, "the levels", (count + 1) * sizeof now);
    out->marks[count] = now;
    for (size_t d = 0; d < drivers; d++) {
        out->mark_certified[count * drivers + d] = run->certified[d];
        out->mark_predicted[count * drivers + d] = run->predicted[d];
    }
    out->mark_count++;
    return TETLOD_OK;
}

static double shrunk_since_mark(const struct run *run)
{
    return run->out->marks[run->out->mark_count - 1].vertices / (double)run->complex->vertices_alive;
}

static bool finished(const struct run *run)
{
    return run->complex->tets_alive <= run->options->min_tets;
}

static enum tetlod_status report(struct run *run)
{
    const struct complex *complex = run->complex;
    if (!run->options->progress || complex->contraction_count % 256)
        return TETLOD_OK;
    // vertices fall about as the logarithm of the limit rises; both together make a steady bar
    double done = log((double)complex->vertex_count / complex->vertices_alive) / log(complex->vertex_count / 8.0 + 2);
    if (run->options->progress(run->options->progress_opaque, fmin(done, 1)))
        return TETLOD_OK;
    return tetlodi_fail(run->error, TETLOD_ERR_CANCELLED, "cancelled");
}

/* All contractions that the limit allows. */
static enum tetlod_status climb(struct run *run)
{
    while (run->queue.count && !finished(run)) {
        struct queue_entry entry = queue_pop(&run->queue);
        if (obsolete(run->complex, &entry))
            continue;
        if (stale(run->complex, &entry)) {
            TETLOD_TRY(evaluate_and_file(run, &entry));
            continue;
        }
        TETLOD_TRY(contract(run, &entry));
        TETLOD_TRY(report(run));
        if (shrunk_since_mark(run) >= run->options->growth)
            TETLOD_TRY(mark(run));
    }
    return TETLOD_OK;
}

enum verdict { GONE, STAYS, MOVES };

struct rescan {
    struct run *run;
    struct queue_entry *entries;
    uint8_t *verdicts; /* enum verdict */
};

static void rescan_range(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct rescan *rescan = context;
    const struct run *run = rescan->run;
    struct judge *judge = &rescan->run->judges[worker];
    for (size_t i = begin; i < end && judge->status == TETLOD_OK; i++) {
        struct queue_entry *entry = &rescan->entries[i];
        bool allowed = false;
        rescan->verdicts[i] = STAYS;
        if (entry->value > run->limit && !stale(run->complex, entry)) // most
            continue;
        rescan->verdicts[i] = GONE;
        if (obsolete(run->complex, entry))
            continue;
        if (entry->value <= run->limit || may_have_eased(run->complex, entry))
            judge->status = evaluate(run, judge, entry, &allowed);
        rescan->verdicts[i] = allowed ? MOVES : STAYS;
    }
}

/* Looks again at what waits: entries that the new limit may allow, and those whose bound may have changed. All of them as
 * things are now, so that the threads do not matter. */
static enum tetlod_status rescan(struct run *run, bool *out_any)
{
    struct queue *waiting = &run->waiting;
    struct rescan rescan = {run, waiting->entries, array_new(waiting->count, 1)};
    if (!rescan.verdicts)
        return tetlodi_fail_nomem(run->error, "the queue", waiting->count);
    parallel_for(run->judge_count, waiting->count, 512, rescan_range, &rescan);
    enum tetlod_status status = first_failure(run);
    for (size_t i = waiting->count; i-- > 0 && status == TETLOD_OK;) {
        if (rescan.verdicts[i] == STAYS)
            continue;
        if (rescan.verdicts[i] == MOVES)
            status = file(run, &waiting->entries[i], true);
        waiting->entries[i] = waiting->entries[--waiting->count]; // the last one, which stays, takes its place
    }
    free(rescan.verdicts);
    *out_any = run->queue.count > 0;
    return status;
}

static void fresh_range(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct rescan *rescan = context;
    struct judge *judge = &rescan->run->judges[worker];
    for (size_t i = begin; i < end && judge->status == TETLOD_OK; i++) {
        bool allowed = false;
        judge->status = evaluate(rescan->run, judge, &rescan->entries[i], &allowed);
        rescan->verdicts[i] = allowed ? MOVES : STAYS;
    }
}

/* Gives the simplices that the last contractions have made their keys. */
static enum tetlod_status file_fresh(struct run *run)
{
    struct queue *fresh = &run->fresh;
    struct rescan rescan = {run, fresh->entries, array_new(fresh->count, 1)};
    enum tetlod_status status;
    if (!rescan.verdicts)
        return tetlodi_fail_nomem(run->error, "the queue", fresh->count);
    parallel_for(run->judge_count, fresh->count, 16, fresh_range, &rescan);
    status = first_failure(run);
    for (size_t i = 0; i < fresh->count && status == TETLOD_OK; i++)
        status = file(run, &fresh->entries[i], rescan.verdicts[i] == MOVES);
    fresh->count = 0;
    free(rescan.verdicts);
    return status;
}

/* The same under the exact limit: it is asked about a batch at a time. */
static enum tetlod_status climb_exactly(struct run *run)
{
    while (run->queue.count && !finished(run)) {
        size_t count = 0;
        while (run->queue.count && count < BATCH) {
            run->works[count].entry = queue_pop(&run->queue);
            count += !obsolete(run->complex, &run->works[count].entry);
        }
        run->batch_key = run->queue.count ? run->queue.entries[0].value : INFINITY;
        parallel_for(run->judge_count, count, 1, work_range, run);
        TETLOD_TRY(first_failure(run));
        for (size_t i = 0; i < count; i++) {
            uint32_t before = run->complex->contraction_count;
            for (uint32_t k = 0; k < run->works[i].witness_count; k++)
                overlaps_watch(&run->overlaps, &run->works[i].witnesses[k]);
            if (run->works[i].outcome == ALLOWED && !finished(run))
                TETLOD_TRY(contract_exactly(run, &run->works[i]));
            else
                TETLOD_TRY(file(run, &run->works[i].entry, run->works[i].outcome != REFUSED));
            if (run->complex->contraction_count == before)
                continue;
            TETLOD_TRY(report(run));
            if (shrunk_since_mark(run) >= run->options->growth)
                TETLOD_TRY(mark(run));
        }
        TETLOD_TRY(file_fresh(run));
    }
    return TETLOD_OK;
}

/* One rung: contract, look again, until nothing moves any more. */
static enum tetlod_status rung(struct run *run, double limit, bool named)
{
    bool any;
    run->limit = limit;
    run->chance = named ? CHANCE_NAMED : CHANCE;
    TETLOD_TRY(rescan(run, &any));
    for (int round = 0; any && !finished(run) && round < 4; round++) {
        uint32_t before = run->complex->contraction_count;
        TETLOD_TRY(is_exact(run) ? climb_exactly(run) : climb(run));
        if (run->complex->contraction_count == before)
            break;
        TETLOD_TRY(rescan(run, &any));
    }
    return TETLOD_OK;
}

static enum tetlod_status run_ladder(struct run *run)
{
    bool named = true;
    double limit = fmin(1e-6, run->options->max_error);
    TETLOD_TRY(mark(run));
    for (uint32_t v = 0; v < run->complex->vertex_count; v++)
        TETLOD_TRY(list_simplices(run, v, true));
    for (;;) {
        TETLOD_TRY(rung(run, limit, named));
        double shrunk = shrunk_since_mark(run);
        if (shrunk > (named ? 1 : sqrt(run->options->growth)))
            TETLOD_TRY(mark(run));
        if (finished(run) || limit >= run->options->max_error)
            break;
        limit = next_limit(limit, run->options->max_error, &named);
    }
    return mark(run);
}

static bool asks_envelopes(const struct simplify_options *options)
{
    return options->metric != METRIC_MEASURED && !(options->certify == CERTIFY_EXACT && metric_has_quadrics(options->metric));
}

static enum tetlod_status make_judges(struct run *run)
{
    unsigned threads = run->options->threads ? run->options->threads : 1;
    run->judge_count = threads < PARALLEL_MOST_THREADS ? threads : PARALLEL_MOST_THREADS;
    run->judges = array_zero(run->judge_count, sizeof *run->judges);
    if (!run->judges)
        return tetlodi_fail_nomem(run->error, "the threads", run->judge_count * sizeof *run->judges);
    for (unsigned j = 0; j < run->judge_count; j++) {
        TETLOD_TRY(metric_init(&run->judges[j].scratch, run->fields, run->error));
        if (is_exact(run))
            TETLOD_TRY(examiner_init(&run->judges[j].examiner, run->complex, run->fields, run->error));
        TETLOD_TRY(sampler_init(&run->judges[j].sampler, run->fields, run->error));
    }
    return TETLOD_OK;
}

static enum tetlod_status make_works(struct run *run, const struct tetmesh *mesh)
{
    size_t drivers = run->fields->driver_count;
    run->works = array_zero(BATCH, sizeof *run->works);
    run->work_values = array_new(2 * BATCH * drivers, sizeof *run->work_values);
    if (!run->works || !run->work_values)
        return tetlodi_fail_nomem(run->error, "the works", BATCH * (sizeof *run->works + 16 * drivers));
    for (size_t i = 0; i < BATCH; i++) {
        run->works[i].values = run->work_values + 2 * i * drivers;
        run->works[i].errors = run->works[i].values + drivers;
    }
    return overlaps_init(&run->overlaps, mesh, run->error);
}

static void free_judges(struct run *run)
{
    for (unsigned j = 0; j < run->judge_count && run->judges; j++) {
        star_fini(&run->judges[j].star);
        metric_fini(&run->judges[j].scratch);
        examiner_fini(&run->judges[j].examiner);
        sampler_fini(&run->judges[j].sampler);
    }
    free(run->judges);
}

enum tetlod_status simplify(struct simplification *out, const struct tetmesh *mesh, const uint32_t *controlled,
                            uint32_t controlled_count, const double *limits, const struct simplify_options *options,
                            struct tetlod_error *error)
{
    *out = (struct simplification){0};
    struct run run = {.options = options, .out = out, .complex = &out->complex, .fields = &out->fields, .error = error};
    enum tetlod_status status;
    TETLOD_TRY_DONE(complex_init(&out->complex, mesh, error));
    TETLOD_TRY_DONE(fields_init(&out->fields, mesh, controlled, controlled_count, limits, error));
    if (metric_has_quadrics(options->metric))
        TETLOD_TRY_DONE(fields_init_quadrics(&out->fields, &out->complex, options->metric == METRIC_QUADRIC, error));
    if (asks_envelopes(options))
        TETLOD_TRY_DONE(metric_init_envelopes(options->metric, &out->fields, &out->complex, error));
    TETLOD_TRY_DONE(boundary_init(&run.boundary, &out->complex, options->boundary_angle, options->boundary_limit, error));
    if (options->certify == CERTIFY_EXACT)
        TETLOD_TRY_DONE(make_works(&run, mesh));
    if (options->metric == METRIC_MEASURED)
        TETLOD_TRY_DONE(samples_init(&run.samples, mesh, &out->complex, &out->fields, error));
    TETLOD_TRY_DONE(make_judges(&run));
    run.certified = array_zero(3 * (size_t)out->fields.driver_count, sizeof(double));
    run.outcome = array_new(out->fields.driver_count, sizeof *run.outcome);
    if (!run.certified || !run.outcome)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the drivers", 56 * (uint64_t)out->fields.driver_count));
    run.predicted = run.certified + out->fields.driver_count;
    run.assigned = run.predicted + out->fields.driver_count;
    status = run_ladder(&run);
done:
    boundary_fini(&run.boundary);
    overlaps_fini(&run.overlaps);
    samples_fini(&run.samples);
    free_judges(&run);
    queue_fini(&run.queue);
    queue_fini(&run.waiting);
    queue_fini(&run.fresh);
    free(run.works);
    free(run.work_values);
    free(run.certified);
    free(run.outcome);
    free(run.link);
    free(run.thawed);
    if (status != TETLOD_OK)
        simplification_fini(out);
    return status;
}

void simplification_fini(struct simplification *simplification)
{
    complex_fini(&simplification->complex);
    fields_fini(&simplification->fields);
    free(simplification->marks);
    free(simplification->mark_certified);
    free(simplification->mark_predicted);
    *simplification = (struct simplification){0};
}
