/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/simplify/evaluator.h"

#include <math.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"

_Static_assert((int)MOST_TRIALS <= (int)QUEUE_CANDIDATES && MOST_TRIALS <= 32, "an entry has a bit for each candidate");

/* Trials are followed to this multiple of the limit, so that most of what waits is not looked at on the next rungs. */
static const double CUTOFF = 2;

/* So many tetrahedra around each vertex of a simplex are asked before its whole star is gathered. */
enum { AROUND = 4 };

/* The metric's own optimum for a simplex inside the domain, near enough to it to be worth a trial. It is tried behind the
 * candidates. */
static bool optimum_position(const struct run *run, const struct star *star, double p[3])
{
    const struct complex *complex = run->complex;
    double reach2 = 0, far2 = 0;
    if (!metric_has_quadrics(run->options->metric))
        return false;
    for (uint32_t s = 0; s < star->simplex_count; s++)
        if (complex->flags[star->simplex[s]] & (VERTEX_BOUNDARY | VERTEX_FIXED))
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
static double cutoff(const struct run *run)
{
    return is_exact(run) ? INFINITY : CUTOFF * run->limit;
}

enum tetlod_status evaluator_try(const struct run *run, struct evaluator *evaluator, const struct boundary_map *map, double most,
                             struct trial *trials, uint32_t count)
{
    if (run->options->metric == METRIC_MEASURED)
        return samples_try(&run->samples, &evaluator->sampler, run->complex, run->fields, &evaluator->star, run->limit, most,
                           trials, count, &evaluator->error);
    metric_try(run->options->metric, &evaluator->scratch, run->fields, run->complex, &evaluator->star, map, most, trials, count);
    return TETLOD_OK;
}

void evaluator_assigned(const struct run *run, const struct evaluator *evaluator, double *values)
{
    if (run->options->metric == METRIC_MEASURED)
        samples_assigned(&evaluator->sampler, run->fields, 0, values);
    else
        metric_assigned(&evaluator->scratch, run->fields, 0, values);
}

/* Lets the boundary have its say on a trial that the fields allow: it may forbid it, or demand more of the values. */
static void ask_boundary(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry, struct trial *trial,
                         uint32_t number)
{
    double before = trial->error;
    double moved = boundary_moves(&run->boundary, run->complex, &evaluator->star, trial->position, &evaluator->map);
    if (!(moved <= run->boundary.limit)) {
        trial->error = INFINITY;
        evaluator->refused[LOG_REFUSED_BOUNDARY]++;
    } else if (metric_is_certified(run->options->metric) && !is_exact(run))
        metric_demand(&evaluator->scratch, run->fields, &evaluator->map, number, &trial->error);
    if (trial->error > before)
        entry->witness_count = QUEUE_WITNESSES + 1;
}

/* Tries all candidates on the evaluator's star by the fields alone. */
static enum tetlod_status try_candidates(const struct run *run, struct evaluator *evaluator)
{
    struct trial *trials = evaluator->trials;
    uint32_t vertices = evaluator->star.simplex_count, count = candidates_count(vertices, run->options->candidates);
    for (uint32_t c = 0; c < count; c++) {
        candidate_position(run->complex, &evaluator->star, c, trials[c].position);
        trials[c].possible = boundary_allows(&run->boundary, run->complex, &evaluator->star, candidates_weights(vertices, c),
                                             trials[c].position);
    }
    trials[count].possible = optimum_position(run, &evaluator->star, trials[count].position);
    evaluator->trial_count = count += trials[count].possible;
    return evaluator_try(run, evaluator, NULL, cutoff(run), trials, count);
}

/* What else is to be said of what was tried. */
static void evaluator_trials(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry)
{
    for (uint32_t c = 0; c < evaluator->trial_count; c++) {
        struct trial *trial = &evaluator->trials[c];
        if (entry->refused & UINT32_C(1) << c)
            continue;
        remember_witnesses(entry, trial->witness);
        if (!trial->possible) {
            entry->refused |= UINT32_C(1) << c;
            continue;
        }
        if (is_exact(run)) // it is asked only when the candidate's turn comes, if its estimate is not too large
            trial->error = metric_has_quadrics(run->options->metric) ? trial->error / run->most_expected : 0;
        if (trial->error <= run->limit)
            ask_boundary(run, evaluator, entry, trial, c);
    }
}

enum tetlod_status evaluator_try_all(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry)
{
    TETLOD_TRY(try_candidates(run, evaluator));
    evaluator_trials(run, evaluator, entry);
    return TETLOD_OK;
}

double evaluator_best(const struct run *run, const struct evaluator *evaluator, struct queue_entry *entry)
{
    double best = INFINITY, least = INFINITY;
    for (uint32_t c = 0; c < evaluator->trial_count; c++) {
        const struct trial *trial = &evaluator->trials[c];
        if (entry->refused & UINT32_C(1) << c)
            continue;
        least = smaller(least, trial->error);
        double key = metric_key(run->options->metric, trial, evaluator->star.removed_count);
        if (trial->error <= run->limit && key < best) {
            best = key;
            entry->candidate = c;
        }
    }
    entry->value = best;
    return least;
}

/* Tetrahedra that are likely to refuse a simplex: those that have refused it, or its like, before, and some all around each of its
 * vertices. */
static uint32_t likely_tets(const struct complex *complex, const struct queue_entry *entry, uint32_t *tets)
{
    uint32_t count = entry->witness_count <= QUEUE_WITNESSES ? entry->witness_count : 0;
    memcpy(tets, entry->witness, count * sizeof *tets);
    for (uint32_t i = 0; i < AROUND; i++)
        for (uint32_t s = 0; s < vertex_count(entry); s++) {
            uint32_t v = entry->vertices[s];
            tets[count++] = complex->pool[complex->star_begin[v] + (uint64_t)i * complex->star_count[v] / AROUND];
        }
    return count;
}

/* Is the simplex refused beyond the cutoff by these alone? Most that waits is, and its star need not be gathered. Then the entry's
 * value is a lower bound of its error. */
static enum tetlod_status refused_early(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry,
                                        bool *out_refused)
{
    uint32_t tets[QUEUE_WITNESSES + 4 * AROUND], count = likely_tets(run->complex, entry, tets);
    *out_refused = false;
    entry->witness_count = 0;
    TETLOD_TRY(star_gather_some(&evaluator->star, run->complex, entry->vertices, vertex_count(entry), tets, count,
                                &evaluator->error));
    if (!evaluator->star.tet_count || evaluator->star.at_one_point)
        return TETLOD_OK;
    TETLOD_TRY(try_candidates(run, evaluator));
    for (uint32_t c = 0; c < evaluator->trial_count; c++)
        if (evaluator->trials[c].possible && !(evaluator->trials[c].error > cutoff(run)))
            return TETLOD_OK;
    evaluator_trials(run, evaluator, entry);
    entry->value = evaluator_best(run, evaluator, entry);
    *out_refused = true;
    return TETLOD_OK;
}

bool may_be_contracted(const struct run *run, const struct queue_entry *entry)
{
    const struct complex *complex = run->complex;
    const double *first = complex->positions + 3 * (size_t)entry->vertices[0];
    bool at_one_point = run->options->metric != METRIC_MEASURED && !is_exact(run), frozen = false;
    for (uint32_t i = 0; i < vertex_count(entry); i++) {
        if (complex->flags[entry->vertices[i]] & VERTEX_SINGULAR)
            return false;
        frozen |= complex->flags[entry->vertices[i]] & VERTEX_FROZEN;
        at_one_point &= distance_squared(first, complex->positions + 3 * (size_t)entry->vertices[i]) == 0;
    }
    return at_one_point || !frozen;
}

enum tetlod_status evaluate_simplex(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry,
                                  bool *out_allowed)
{
    bool refused = false;
    entry->stamp = run->complex->log.count;
    entry->refused = 0;
    entry->bound = INFINITY;
    *out_allowed = false;
    if (run->options->metric != METRIC_MEASURED && !is_exact(run))
        TETLOD_TRY(refused_early(run, evaluator, entry, &refused));
    if (refused)
        return TETLOD_OK;
    entry->witness_count = 0;
    TETLOD_TRY(star_gather(&evaluator->star, run->complex, entry->vertices, vertex_count(entry), &evaluator->error));
    TETLOD_TRY(evaluator_try_all(run, evaluator, entry));
    double error = evaluator_best(run, evaluator, entry);
    *out_allowed = error <= run->limit;
    entry->value = *out_allowed ? entry->value : error;
    return TETLOD_OK;
}

bool evaluator_place(const struct run *run, struct evaluator *evaluator, const struct queue_entry *entry, double p[3],
                 double *moved)
{
    const struct star *star = &evaluator->star;
    if (entry->candidate < candidates_count(star->simplex_count, run->options->candidates))
        candidate_position(run->complex, star, entry->candidate, p);
    else if (!optimum_position(run, star, p))
        return false;
    *moved = boundary_moves(&run->boundary, run->complex, star, p, &evaluator->map);
    bool stays = *moved <= run->boundary.limit, fits = stays && star_fits(star, run->complex, p);
    evaluator->refused[LOG_REFUSED_BOUNDARY] += !stays;
    evaluator->refused[LOG_REFUSED_FLIP] += stays && !fits;
    return fits;
}
