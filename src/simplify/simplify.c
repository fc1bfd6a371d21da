/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/simplify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/simplify/evaluator.h"
#include "src/simplify/ladder.h"
#include "src/simplify/regions.h"
#include "src/simplify/rounds.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "src/util/crew.h"

/* Examining a position stops where the error is above this multiple of the limit, on rungs that levels are named after; on the others it
 * stops at the limit. Positions between the candidates are searched for from those below it. */
static const double EXACT_CUTOFF = 1.2;

/* Tetrahedra and slots are renumbered where no larger fraction of them is left. */
static const double MOST_LEFT = 0.96;

/* So many that wait are evaluated at a time. */
enum { RESCANNED = 2048 };

/* If every candidate misses the limit by little, positions between them are searched: at most MOST_STEPS steps, each halved at most HALVINGS
 * times. A step is made while the error that is expected of it is below STEP_EXPECTED times the limit, and the last step's error was below
 * STEP_NEEDED times the limit. */
enum { MOST_STEPS = 12, HALVINGS = 2 };
static const double STEP_EXPECTED = 1.12, STEP_NEEDED = 1.1;

/* The exact limit is not asked about a candidate if the quadric expects a root mean square above this multiple of the limit: of candidates
 * above 1.4 it would refuse about 99 in a hundred. Between the rungs that levels are named after fewer candidates are asked about. */
static const double MOST_EXPECTED = 1, MOST_EXPECTED_NAMED = 1.4;

/* Takes what is obsolete out of those that wait. */
static void clear_waiting(struct run *run)
{
    struct waiting_list *waiting = &run->waiting;
    for (size_t at = 0; at < waiting->size; at = waiting_list_next(waiting, at)) {
        struct queue_entry entry = waiting_list_get(waiting, at);
        if (obsolete(run->complex, &entry))
            waiting_list_take(waiting, at);
    }
    waiting_list_sweep(waiting);
}

/* The same, if many have joined them since. */
static void clear_if_grown(struct run *run)
{
    if (waiting_list_has_grown(&run->waiting))
        clear_waiting(run);
}

/* Into the queue, or with those that wait for a higher rung. */
static enum tetlod_status file(struct run *run, const struct queue_entry *entry, bool allowed)
{
    if (allowed ? queue_push(&run->queue, entry) : waiting_list_add(&run->waiting, entry))
        return TETLOD_OK;
    return tetlodi_fail_nomem(run->error, "the queue", run->queue.capacity * sizeof *entry);
}

static enum tetlod_status evaluate_and_file(struct run *run, struct queue_entry *entry)
{
    bool allowed;
    if (!may_be_contracted(run, entry))
        return TETLOD_OK;
    if (evaluate_simplex(run, run->evaluators, entry, &allowed) != TETLOD_OK) {
        *run->error = run->evaluators->error;
        return run->evaluators->error.status;
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
    if (!first && may_be_contracted(run, &entry) && !queue_append(&run->fresh, &entry))
        return tetlodi_fail_nomem(run->error, "the queue", run->fresh.capacity * sizeof entry);
    return first && entry.vertices[0] == v && may_be_contracted(run, &entry) ? file(run, &entry, false) : TETLOD_OK;
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
static enum tetlod_status unfreeze(struct run *run, uint32_t v)
{
    size_t count = 0;
    TETLOD_TRY(complex_link_vertices(run->complex, v, &run->unfrozen, &run->unfrozen_capacity, &count, run->error));
    complex_unfreeze(run->complex, v);
    for (size_t i = 0; i < count; i++)
        if (complex_unfreeze(run->complex, run->unfrozen[i]))
            TETLOD_TRY(list_simplices(run, run->unfrozen[i], false));
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

/* Contracts what all checks have accepted; `errors` are what the drivers' are certified to be. */
static enum tetlod_status perform(struct run *run, const struct star *star, const double p[3], double moved,
                                  const double *errors)
{
    uint32_t v = star->simplex[0];
    double most = smaller(boundary_map_most(&run->evaluators->map, run->boundary.most), run->boundary.limit);
    fields_contract(run->fields, run->complex, star, p, run->outcome);
    TETLOD_TRY(complex_contract(run->complex, star, p, run->error));
    metric_update_envelopes(run->options->metric, run->fields, run->complex, v);
    boundary_update(&run->boundary, run->complex, v, moved, most);
    run->moved = larger(run->moved, moved);
    for (uint32_t d = 0; d < run->fields->driver_count; d++) {
        const struct driver *driver = &run->fields->drivers[d];
        double certain = smaller(errors[d] * driver->scale, rounded_limit(run, driver));
        run->certified[d] = larger(run->certified[d], smaller(certain, 1)); // values never leave the range
        run->predicted[d] = fmax(run->predicted[d], driver->predicted[v] * driver->scale);
        if (run->options->local_bound)
            run->complex->log.components[d].bounds[run->complex->log.count - 1] = errors[d];
    }
    if (star->at_one_point)
        TETLOD_TRY(unfreeze(run, v));
    return list_simplices(run, v, false);
}

/* Does a fresh entry, unless a check that is made only now refuses it. */
static enum tetlod_status contract(struct run *run, const struct queue_entry *entry)
{
    double p[3], moved;
    bool holds;
    struct evaluator *evaluator = run->evaluators;
    struct star *star = &evaluator->star;
    TETLOD_TRY(star_gather(star, run->complex, entry->vertices, vertex_count(entry), run->error));
    if (!evaluator_place(run, evaluator, entry, p, &moved))
        return refuse(run, *entry, INFINITY);
    TETLOD_TRY(star_link_condition(star, run->complex, &holds, run->error));
    if (!holds) {
        evaluator->refused[LOG_REFUSED_LINK]++;
        return refuse(run, *entry, INFINITY);
    }
    struct trial trial = {.position = {p[0], p[1], p[2]}, .possible = true};
    if (evaluator_try(run, evaluator, &evaluator->map, run->limit, &trial, 1) != TETLOD_OK) {
        *run->error = evaluator->error;
        return run->error->status;
    }
    if (run->options->metric == METRIC_MEASURED && (!trial.possible || trial.error > run->limit))
        return refuse(run, *entry, trial.possible ? trial.error : INFINITY);
    evaluator_assigned(run, evaluator, run->assigned);
    fields_outcome(run->fields, run->complex, star, &evaluator->map, p, run->assigned, run->outcome);
    double certified = outcome_error(run->fields, run->outcome);
    if (metric_is_certified(run->options->metric) && certified > run->limit * (1 + LIMIT_TIE)) { // its rounding is too much
        evaluator->refused[LOG_REFUSED_ROUNDING]++;
        return refuse(run, *entry, certified);
    }
    if (run->options->metric == METRIC_MEASURED)
        samples_contract(&run->samples, &evaluator->sampler, run->fields, star, trial.error);
    if (run->options->metric == METRIC_ENVELOPE)
        fields_cheapen(run->fields, run->complex, star, p, run->certified, run->outcome);
    for (uint32_t d = 0; d < run->fields->driver_count; d++)
        run->assigned[d] = larger(run->outcome[d].upper - run->outcome[d].value,
                                  run->outcome[d].value - run->outcome[d].lower);
    return perform(run, star, p, moved, run->assigned);
}

/* ---- the exact limit */

/* The entry's candidate is refused; its next best is chosen. *io_tried: the evaluator has tried all on this star; *out_left: there is one. */
static enum tetlod_status next_candidate(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry,
                                         const struct finding *finding, bool *io_tried, bool *out_left)
{
    uint32_t a = finding->witness[0].tet, b = finding->witness[1].tet;
    entry->refused |= UINT32_C(1) << entry->candidate;
    entry->bound = smaller(entry->bound, finding->error);
    remember_witnesses(entry, (uint32_t[]){a == TETLOD_NONE ? b : a, b == TETLOD_NONE ? a : b});
    if (!*io_tried)
        TETLOD_TRY(evaluator_try_all(run, evaluator, entry));
    *io_tried = true;
    double least = evaluator_best(run, evaluator, entry);
    *out_left = isfinite(entry->value);
    if (!*out_left) // what is left waits for as much; else it is asked next, and the answer counts
        entry->bound = smaller(entry->bound, least);
    return TETLOD_OK;
}

/* Asks the exact limit about the item's position on the star that was taken up. */
static enum tetlod_status ask(const struct run *run, struct evaluator *evaluator, struct batch_entry *item, double cutoff,
                              bool whole, struct finding *out)
{
    size_t size = run->fields->driver_count * sizeof(double);
    TETLOD_TRY(exact_examine(&evaluator->examiner, &run->overlaps, run->complex, run->fields, &evaluator->star, item->position,
                             run->limit, cutoff, whole, out, &evaluator->error));
    if (!out->allowed)
        return TETLOD_OK;
    memcpy(item->values, evaluator->examiner.chosen, size);
    memcpy(item->errors, evaluator->examiner.errors, size);
    item->outcome = ALLOWED;
    return exact_pass_on(&evaluator->examiner, run->complex, &item->passed, &evaluator->error);
}

/* May the star be contracted to a position that is none of the candidates? */
static bool may_go(const struct run *run, struct evaluator *evaluator, const double p[3])
{
    static const double anywhere[4] = {0.25, 0.25, 0.25, 0.25};
    return boundary_allows(&run->boundary, run->complex, &evaluator->star, anywhere, p) &&
           boundary_moves(&run->boundary, run->complex, &evaluator->star, p, &evaluator->map) <= run->boundary.limit &&
           star_fits(&evaluator->star, run->complex, p);
}

/* All candidates are refused, the one at item->position by the least: goes on from there, each step to where less is needed,
 * until that is allowed or no step is worth making. */
static enum tetlod_status search(const struct run *run, struct evaluator *evaluator, struct batch_entry *item)
{
    struct finding finding;
    double from[3], step[3], expected, most = EXACT_CUTOFF * run->limit;
    TETLOD_TRY(ask(run, evaluator, item, most, true, &finding));
    for (int steps = 0; steps < MOST_STEPS && !finding.allowed && finding.error < most; steps++) {
        double best = finding.error;
        memcpy(from, item->position, sizeof from);
        TETLOD_TRY(descent_step(&evaluator->descent, &evaluator->examiner, &run->boundary, run->complex, run->fields, &evaluator->star,
                                step, &expected, &evaluator->error));
        for (int halving = 0; halving <= HALVINGS && expected < STEP_EXPECTED * run->limit && !(finding.error < best); halving++) {
            for (int i = 0; i < 3; i++)
                item->position[i] = from[i] + step[i] / (1 << halving);
            complex_round_position(run->complex, item->position);
            if (may_go(run, evaluator, item->position))
                TETLOD_TRY(ask(run, evaluator, item, best, true, &finding));
        }
        if (!(finding.error < best))
            break;
        most = STEP_NEEDED * run->limit;
    }
    return TETLOD_OK;
}

/* Examines a fresh entry's candidates, best first, until one is allowed or it is not its turn any more. Changes nothing but the evaluator and the item. */
static enum tetlod_status examine(const struct run *run, struct evaluator *evaluator, struct batch_entry *item)
{
    struct queue_entry *entry = &item->entry;
    double cutoff = (run->named ? EXACT_CUTOFF : 1) * run->limit, least = INFINITY, nearest[3], moved;
    bool tried = false;
    item->witness_count = 0;
    TETLOD_TRY(star_gather(&evaluator->star, run->complex, entry->vertices, vertex_count(entry), &evaluator->error));
    TETLOD_TRY(exact_begin(&evaluator->examiner, run->complex, run->fields, &evaluator->star, &evaluator->error));
    do {
        struct finding finding = {.error = INFINITY, .witness = {{.tet = TETLOD_NONE}, {.tet = TETLOD_NONE}}};
        double key = entry->value;
        bool left;
        item->outcome = REFUSED;
        if (evaluator_place(run, evaluator, entry, item->position, &moved))
            TETLOD_TRY(ask(run, evaluator, item, cutoff, false, &finding));
        else
            entry->witness_count = QUEUE_WITNESSES + 1;
        evaluator->refused[LOG_REFUSED_SIZE] += finding.large;
        if (finding.allowed)
            return TETLOD_OK;
        if (finding.error < least) {
            least = finding.error;
            memcpy(nearest, item->position, sizeof nearest);
        }
        for (int i = 0; i < 2 && item->witness_count < 8; i++)
            item->witnesses[item->witness_count++] = finding.witness[i];
        TETLOD_TRY(next_candidate(run, evaluator, entry, &finding, &tried, &left));
        if (!left && run->named && least < cutoff) {
            memcpy(item->position, nearest, sizeof nearest);
            TETLOD_TRY(search(run, evaluator, item));
        }
        if (!left) {
            entry->value = item->outcome == ALLOWED ? key : entry->bound;
            return TETLOD_OK;
        }
    } while (entry->value <= run->batch_key);
    item->outcome = FILED; // others come before its next candidate
    return TETLOD_OK;
}

static void examine_range(void *context, unsigned worker, size_t begin, size_t end)
{
    struct run *run = context;
    struct evaluator *evaluator = &run->evaluators[worker];
    for (size_t i = begin; i < end && evaluator->status == TETLOD_OK; i++) {
        struct batch_entry *item = &run->batch_entries[i];
        bool allowed;
        if (!stale(run->complex, &item->entry)) {
            evaluator->status = examine(run, evaluator, item);
            continue;
        }
        item->witness_count = 0;
        evaluator->status = evaluate_simplex(run, evaluator, &item->entry, &allowed);
        item->outcome = allowed ? FILED : REFUSED;
    }
}

/* Contracts an entry that was allowed, if nothing else of its batch is in the way. */
static enum tetlod_status contract_exactly(struct run *run, const struct batch_entry *item)
{
    const double *p = item->position;
    bool holds;
    struct star *star = &run->evaluators->star;
    const struct queue_entry *entry = &item->entry;
    if (obsolete(run->complex, entry))
        return TETLOD_OK;
    if (stale(run->complex, entry))
        return file(run, entry, true);
    TETLOD_TRY(star_gather(star, run->complex, entry->vertices, vertex_count(entry), run->error));
    TETLOD_TRY(star_link_condition(star, run->complex, &holds, run->error));
    if (!holds) {
        run->evaluators->refused[LOG_REFUSED_LINK]++;
        return refuse(run, *entry, INFINITY);
    }
    double moved = boundary_moves(&run->boundary, run->complex, star, p, &run->evaluators->map);
    fields_outcome(run->fields, run->complex, star, &run->evaluators->map, p, item->values, run->outcome);
    TETLOD_TRY(overlaps_take(&run->overlaps, star, &item->passed, run->error));
    return perform(run, star, p, moved, item->errors);
}

static enum tetlod_status first_failure(struct run *run)
{
    for (unsigned j = 0; j < crew_size(run->crew); j++) {
        if (run->evaluators[j].status != TETLOD_OK) {
            *run->error = run->evaluators[j].error;
            return run->evaluators[j].status;
        }
        if (run->evaluators[j].map.failed)
            return tetlodi_fail_nomem(run->error, "a boundary", 0);
    }
    return TETLOD_OK;
}

/* ---- marks and rungs */

static enum tetlod_status mark(struct run *run)
{
    return log_mark(&run->complex->log, run->complex->vertices_alive, run->complex->tets_alive, run->moved, run->certified,
                    run->predicted, run->error);
}

static double shrunk_since_mark(const struct run *run)
{
    const struct contraction_log *log = &run->complex->log;
    return log->marks[log->mark_count - 1].vertices / (double)run->complex->vertices_alive;
}

static bool finished(const struct run *run)
{
    return run->complex->tets_alive <= run->options->min_tets;
}

static enum tetlod_status report(struct run *run)
{
    const struct complex *complex = run->complex;
    if (!run->options->progress || complex->log.count % 256)
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
        clear_if_grown(run);
        TETLOD_TRY(report(run));
        if (shrunk_since_mark(run) >= run->options->growth)
            TETLOD_TRY(mark(run));
    }
    return TETLOD_OK;
}

/* Simplices that are evaluated side by side; none of that changes the others. */
struct evaluation {
    struct run *run;
    struct queue_entry *entries;
    uint8_t *allowed;
};

static void evaluate_range(void *context, unsigned worker, size_t begin, size_t end)
{
    const struct evaluation *evaluation = context;
    struct evaluator *evaluator = &evaluation->run->evaluators[worker];
    for (size_t i = begin; i < end && evaluator->status == TETLOD_OK; i++) {
        bool allowed = false;
        evaluator->status = evaluate_simplex(evaluation->run, evaluator, &evaluation->entries[i], &allowed);
        evaluation->allowed[i] = allowed;
    }
}

/* Evaluates the fresh simplices as things are now, so that the threads do not matter. *out_allowed is to be freed. */
static enum tetlod_status evaluate_fresh(struct run *run, uint8_t **out_allowed)
{
    struct queue *fresh = &run->fresh;
    struct evaluation evaluation = {run, fresh->entries, array_zero(fresh->count, 1)};
    *out_allowed = evaluation.allowed;
    if (!evaluation.allowed)
        return tetlodi_fail_nomem(run->error, "the queue", fresh->count);
    crew_run(run->crew, fresh->count, 16, evaluate_range, &evaluation);
    return first_failure(run);
}

/* And files them. */
static enum tetlod_status file_fresh(struct run *run)
{
    uint8_t *allowed;
    enum tetlod_status status = evaluate_fresh(run, &allowed);
    for (size_t i = 0; i < run->fresh.count && status == TETLOD_OK; i++)
        status = file(run, &run->fresh.entries[i], allowed[i]);
    run->fresh.count = 0;
    free(allowed);
    return status;
}

/* The same of simplices that waited, in these places: they stay there or go into the queue. */
static enum tetlod_status file_again(struct run *run, const size_t *places)
{
    uint8_t *allowed;
    enum tetlod_status status = evaluate_fresh(run, &allowed);
    for (size_t i = 0; i < run->fresh.count && status == TETLOD_OK; i++)
        if (allowed[i] ? !queue_push(&run->queue, &run->fresh.entries[i])
                       : !waiting_list_replace(&run->waiting, places[i], &run->fresh.entries[i]))
            status = tetlodi_fail_nomem(run->error, "the queue", run->queue.capacity * sizeof(struct queue_entry));
    run->fresh.count = 0;
    free(allowed);
    return status;
}

/* Does an edge wait for a higher limit, with nothing changed around it? Then the rest of it need not be read. */
static inline bool waits_on(const struct run *run, const struct waiting_simplex *simplex)
{
    const uint32_t *changed = run->complex->changed;
    return !simplex->extra && !(simplex->value <= run->limit) && changed[simplex->vertices[0]] <= simplex->stamp &&
           changed[simplex->vertices[1]] <= simplex->stamp;
}

/* Looks again at what waits: entries that the new limit may allow, and those whose bound may have changed. Some at a time, which takes
 * less room. */
static enum tetlod_status rescan(struct run *run, bool *out_any)
{
    struct waiting_list *waiting = &run->waiting;
    size_t places[RESCANNED];
    for (size_t at = 0, end = waiting->size, next; at < end; at = next) {
        next = waiting_list_next(waiting, at);
        if (waits_on(run, waiting_list_at(waiting, at))) // most
            continue;
        struct queue_entry entry = waiting_list_get(waiting, at);
        bool reached = entry.value <= run->limit, gone = (reached || stale(run->complex, &entry)) && obsolete(run->complex, &entry);
        if (!gone && !reached && !may_have_eased(run->complex, &entry)) // most
            continue;
        waiting_list_take(waiting, at);
        if (gone)
            continue;
        places[run->fresh.count] = at;
        if (!queue_append(&run->fresh, &entry))
            return tetlodi_fail_nomem(run->error, "the queue", run->fresh.capacity * sizeof entry);
        if (run->fresh.count == RESCANNED)
            TETLOD_TRY(file_again(run, places));
    }
    TETLOD_TRY(file_again(run, places));
    queue_fini(&run->fresh); // it is large where much was due
    waiting_list_sweep(waiting);
    *out_any = run->queue.count > 0;
    return TETLOD_OK;
}

/* Claims the star of an entry for its batch, unless a contraction of the batch may change it. */
static bool claim(struct run *run, const struct queue_entry *entry)
{
    const struct complex *complex = run->complex;
    uint32_t vertices = vertex_count(entry);
    for (uint32_t i = 0; i < vertices; i++)
        if (run->claims[entry->vertices[i]] == run->batch)
            return false;
    for (uint32_t i = 0; i < vertices; i++) {
        const uint32_t *star = complex->pool + complex->star_begin[entry->vertices[i]];
        for (uint32_t k = 0; k < 4 * complex->star_count[entry->vertices[i]]; k++)
            run->claims[complex->corners[4 * (size_t)star[k / 4] + k % 4]] = run->batch;
    }
    return true;
}

/* Takes a batch from the queue: the least entries of which none is in another's way, so that nothing is asked in vain. Those
 * that are wait for the next batch. */
static enum tetlod_status take_batch(struct run *run, size_t *out_count)
{
    size_t count = 0, postponed = 0;
    run->batch++;
    while (run->queue.count && count < BATCH && postponed < POSTPONED) {
        struct queue_entry entry = queue_pop(&run->queue);
        if (obsolete(run->complex, &entry))
            continue;
        if (stale(run->complex, &entry) || claim(run, &entry))
            run->batch_entries[count++].entry = entry;
        else
            run->postponed[postponed++] = entry;
    }
    while (run->queue.count && obsolete(run->complex, &run->queue.entries[0]))
        queue_pop(&run->queue);
    run->batch_key = run->queue.count ? run->queue.entries[0].value : INFINITY;
    for (size_t i = 0; i < postponed; i++)
        TETLOD_TRY(file(run, &run->postponed[i], true));
    *out_count = count;
    return TETLOD_OK;
}

/* Gives back the room of what is gone, if that is much. Between batches nothing else has numbers of tetrahedra and slots. Where there is no
 * memory for that nothing is renumbered. */
static void renumber(struct run *run)
{
    struct complex *complex = run->complex;
    struct renumbering tets, slots;
    if (complex->tets_alive > MOST_LEFT * complex->tets_stored)
        return;
    clear_waiting(run);
    if (complex_find_numbers(complex, &tets, &slots) && complex_renumber(complex, &tets, &slots)) {
        fields_renumber(run->fields, &tets, &slots);
        boundary_renumber(&run->boundary, &slots);
        overlaps_renumber(&run->overlaps, &tets);
        waiting_list_renumber(&run->waiting, &tets, &slots);
        queue_renumber(&run->queue, &tets, &slots);
        renumber_array(&run->claims, sizeof *run->claims, &slots);
        for (unsigned j = 0; j < crew_size(run->crew); j++)
            cover_renumber(&run->evaluators[j].examiner.cover, &slots);
    }
    renumbering_fini(&tets);
    renumbering_fini(&slots);
}

/* The same under the exact limit: it is asked about a batch at a time. */
static enum tetlod_status climb_exactly(struct run *run)
{
    while (run->queue.count && !finished(run)) {
        size_t count;
        TETLOD_TRY(take_batch(run, &count));
        crew_run(run->crew, count, 1, examine_range, run);
        TETLOD_TRY(first_failure(run));
        for (size_t i = 0; i < count; i++) {
            uint32_t before = run->complex->log.count;
            for (uint32_t k = 0; k < run->batch_entries[i].witness_count; k++)
                overlaps_watch(&run->overlaps, &run->batch_entries[i].witnesses[k]);
            if (run->batch_entries[i].outcome == ALLOWED && !finished(run))
                TETLOD_TRY(contract_exactly(run, &run->batch_entries[i]));
            else
                TETLOD_TRY(file(run, &run->batch_entries[i].entry, run->batch_entries[i].outcome != REFUSED));
            passed_fini(&run->batch_entries[i].passed); // they are large where stars are
            if (run->complex->log.count == before)
                continue;
            TETLOD_TRY(report(run));
            if (shrunk_since_mark(run) >= run->options->growth)
                TETLOD_TRY(mark(run));
        }
        TETLOD_TRY(file_fresh(run));
        clear_if_grown(run);
        renumber(run);
    }
    return TETLOD_OK;
}

/* One rung: contract, look again, until nothing moves any more. */
static enum tetlod_status rung(struct run *run, double limit, bool named)
{
    bool any;
    run->limit = limit;
    run->named = named;
    run->most_expected = named ? MOST_EXPECTED_NAMED : MOST_EXPECTED;
    TETLOD_TRY(rescan(run, &any));
    for (int round = 0; any && !finished(run) && round < 4; round++) {
        uint32_t before = run->complex->log.count;
        TETLOD_TRY(is_exact(run) ? climb_exactly(run) : climb(run));
        TETLOD_TRY(first_failure(run));
        if (!run->queue.count)
            queue_fini(&run->queue);
        if (run->complex->log.count == before)
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
        limit = next_limit(limit, run->options->max_error, 0, &named);
    }
    return mark(run);
}

static bool asks_envelopes(const struct simplify_options *options)
{
    return options->metric != METRIC_MEASURED && !(options->certify == CERTIFY_EXACT && metric_has_quadrics(options->metric));
}

static enum tetlod_status make_evaluators(struct run *run)
{
    run->crew = crew_new(run->options->threads);
    run->evaluators = run->crew ? array_zero(crew_size(run->crew), sizeof *run->evaluators) : NULL;
    if (!run->crew || !run->evaluators)
        return tetlodi_fail_nomem(run->error, "the threads", run->options->threads * sizeof *run->evaluators);
    for (unsigned j = 0; j < crew_size(run->crew); j++) {
        TETLOD_TRY(metric_init(&run->evaluators[j].scratch, run->fields, run->error));
        if (is_exact(run))
            TETLOD_TRY(examiner_init(&run->evaluators[j].examiner, run->complex, run->fields, run->error));
        TETLOD_TRY(sampler_init(&run->evaluators[j].sampler, run->fields, run->error));
    }
    return TETLOD_OK;
}

static enum tetlod_status make_batch(struct run *run, const struct tetmesh *mesh)
{
    size_t drivers = run->fields->driver_count;
    run->batch_entries = array_zero(BATCH, sizeof *run->batch_entries);
    run->batch_values = array_new(2 * BATCH * drivers, sizeof *run->batch_values);
    run->claims = array_zero(run->complex->vertex_count, sizeof *run->claims);
    if (!run->batch_entries || !run->batch_values || !run->claims)
        return tetlodi_fail_nomem(run->error, "a batch", BATCH * (sizeof *run->batch_entries + 16 * drivers));
    for (size_t i = 0; i < BATCH; i++) {
        run->batch_entries[i].values = run->batch_values + 2 * i * drivers;
        run->batch_entries[i].errors = run->batch_entries[i].values + drivers;
    }
    return overlaps_init(&run->overlaps, mesh, run->error);
}

static void free_evaluators(struct run *run)
{
    for (unsigned j = 0; run->evaluators && j < crew_size(run->crew); j++) {
        star_fini(&run->evaluators[j].star);
        metric_fini(&run->evaluators[j].scratch);
        examiner_fini(&run->evaluators[j].examiner);
        sampler_fini(&run->evaluators[j].sampler);
        descent_fini(&run->evaluators[j].descent);
        boundary_map_fini(&run->evaluators[j].map);
    }
    free(run->evaluators);
    crew_free(run->crew);
}

static enum tetlod_status log_drivers(const struct run *run)
{
    uint32_t count = run->fields->driver_count;
    struct log_component *components = array_new(count, sizeof *components);
    if (!components)
        return tetlodi_fail_nomem(run->error, "the drivers", count * sizeof *components);
    for (uint32_t d = 0; d < count; d++) {
        const struct driver *driver = &run->fields->drivers[d];
        components[d] = (struct log_component){.field = driver->field, .component = driver->component, .scale = driver->scale};
    }
    enum tetlod_status status = log_control(&run->complex->log, components, count, run->error);
    free(components);
    if (status == TETLOD_OK && run->options->local_bound)
        status = log_keep_bounds(&run->complex->log, run->error);
    return status;
}

/* The default goes in parallel rounds. */
static bool in_rounds(const struct simplify_options *options)
{
    return options->metric == METRIC_ENVELOPE && options->certify == CERTIFY_FAST && options->contract == CONTRACT_EDGES &&
           options->candidates == 0;
}

enum tetlod_status simplify(struct contraction_log *out, const struct tetmesh *mesh, const uint32_t *controlled,
                            uint32_t controlled_count, const double *limits, const struct simplify_options *options,
                            struct tetlod_error *error)
{
    struct complex complex = {0};
    struct fields fields = {0};
    struct run run = {.options = options, .complex = &complex, .fields = &fields, .error = error};
    enum tetlod_status status;
    *out = (struct contraction_log){0};
    if (in_rounds(options))
        return rounds_simplify(out, mesh, controlled, controlled_count, limits, options, error);
    TETLOD_TRY_DONE(complex_init(&complex, mesh, error));
    TETLOD_TRY_DONE(regions_fix(mesh, options->regions, NULL, complex.flags, error));
    TETLOD_TRY_DONE(fields_init(&fields, mesh, controlled, controlled_count, limits, error));
    TETLOD_TRY_DONE(log_drivers(&run));
    if (metric_has_quadrics(options->metric))
        TETLOD_TRY_DONE(fields_init_quadrics(&fields, &complex, options->metric == METRIC_QUADRIC, error));
    if (asks_envelopes(options))
        TETLOD_TRY_DONE(metric_init_envelopes(options->metric, &fields, &complex, error));
    TETLOD_TRY_DONE(boundary_init(&run.boundary, &complex, options->boundary_angle, options->boundary_limit,
                                  options->boundary_least, error));
    if (options->certify == CERTIFY_EXACT)
        TETLOD_TRY_DONE(make_batch(&run, mesh));
    if (options->metric == METRIC_MEASURED)
        TETLOD_TRY_DONE(samples_init(&run.samples, mesh, &complex, &fields, error));
    TETLOD_TRY_DONE(make_evaluators(&run));
    run.certified = array_zero(3 * (size_t)fields.driver_count, sizeof(double));
    run.outcome = array_new(fields.driver_count, sizeof *run.outcome);
    if (!run.certified || !run.outcome)
        TETLOD_TRY_DONE(tetlodi_fail_nomem(error, "the drivers", 56 * (uint64_t)fields.driver_count));
    run.predicted = run.certified + fields.driver_count;
    run.assigned = run.predicted + fields.driver_count;
    TETLOD_TRY_DONE(run_ladder(&run));
    for (unsigned j = 0; j < crew_size(run.crew); j++)
        for (int r = 0; r < LOG_REFUSALS; r++)
            complex.log.refused[r] += run.evaluators[j].refused[r];
    log_finish(&complex.log);
    *out = complex.log;
    complex.log = (struct contraction_log){0};
done:
    boundary_fini(&run.boundary);
    overlaps_fini(&run.overlaps);
    samples_fini(&run.samples);
    free_evaluators(&run);
    queue_fini(&run.queue);
    waiting_list_fini(&run.waiting);
    queue_fini(&run.fresh);
    for (size_t i = 0; i < BATCH && run.batch_entries; i++)
        passed_fini(&run.batch_entries[i].passed);
    free(run.batch_entries);
    free(run.batch_values);
    free(run.claims);
    free(run.certified);
    free(run.outcome);
    free(run.link);
    free(run.unfrozen);
    fields_fini(&fields);
    complex_fini(&complex);
    return status;
}

/* What a simplex that waits takes with its witnesses, of which the exact limit has fewer. */
static uint64_t waiting_bytes(const struct tetmesh *mesh, const struct simplify_options *options)
{
    uint64_t edges = (uint64_t)mesh->vertex_count + mesh->tet_count, witnesses = options->certify == CERTIFY_EXACT ? 4 : 11;
    return edges * (sizeof(struct waiting_simplex) + witnesses * sizeof(uint32_t));
}

/* The complex, the fields, what waits, and what the metric and the limit keep. */
uint64_t simplify_bytes(const struct tetmesh *mesh, uint32_t controlled_count, const struct simplify_options *options)
{
    if (in_rounds(options))
        return rounds_bytes(mesh, controlled_count);
    uint64_t bytes = complex_bytes(mesh->vertex_count, mesh->tet_count) + fields_bytes(mesh, controlled_count) + waiting_bytes(mesh, options);
    if (metric_has_quadrics(options->metric))
        bytes += mesh->vertex_count * (uint64_t)controlled_count * QUADRIC_SIZE * sizeof(double);
    if (asks_envelopes(options))
        bytes += mesh->tet_count * (uint64_t)controlled_count * sizeof(struct envelope);
    if (options->metric == METRIC_MEASURED)
        bytes += samples_bytes(mesh, controlled_count);
    if (options->certify == CERTIFY_EXACT) // whose log grows while slots are given back
        bytes += overlaps_bytes(mesh->vertex_count, mesh->tet_count) + options->threads * cover_bytes(mesh->vertex_count, mesh->tet_count) -
                 fields_bytes(mesh, 0) / 2;
    return bytes;
}
