/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A star is asked about at one position after the other (examiner.h). If each misses the limit by little, positions
 * between them are searched for (descent.h). What refused is remembered near where it did; what was allowed passes its
 * originals on to its cones.
 */
#include "src/simplify/exact/exact.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/mesh/tet_geom.h"
#include "src/simplify/exact/descent.h"
#include "src/simplify/exact/examiner.h"
#include "src/util/array.h"

/* Examining a position stops where the error is above this multiple of the limit, on rungs that levels are named after;
 * on the others it stops at the limit. Positions between the candidates are searched for from those below it. */
static const double CUTOFF = 1.2;

/* If every candidate misses the limit by little, positions between them are searched: at most MAX_STEPS steps, each
 * halved at most HALVINGS times. A step is made while the error that is expected of it is below STEP_EXPECTED times the
 * limit, and the last step's error was below STEP_NEEDED times the limit. */
enum { MAX_STEPS = 12, HALVINGS = 2 };
static const double STEP_EXPECTED = 1.12, STEP_NEEDED = 1.1;

struct thread {
    struct examiner examiner;
    struct descent descent;
    struct boundary_map map;
};

struct exact {
    struct overlaps overlaps;
    struct thread *threads;
    unsigned thread_count;
};

static void exact_free(void *state)
{
    struct exact *exact = state;
    for (unsigned t = 0; t < exact->thread_count && exact->threads; t++) {
        examiner_fini(&exact->threads[t].examiner);
        descent_fini(&exact->threads[t].descent);
        boundary_map_fini(&exact->threads[t].map);
    }
    free(exact->threads);
    overlaps_fini(&exact->overlaps);
    free(exact);
}

/* ---- asking */

/* Asks about one position. */
static enum tetlod_status examine(struct exact *exact, struct thread *thread, const struct question *question,
                                  const double p[3], double cutoff, bool whole, struct answer *answer,
                                  struct finding *finding, struct tetlod_error *error)
{
    size_t size = question->working->component_count * sizeof(double);
    TETLOD_TRY(exact_examine(&thread->examiner, &exact->overlaps, question->working, question->star, p,
                             question->limit, cutoff,
                             whole, finding, error));
    answer->too_large += finding->large;
    if (!finding->allowed)
        return TETLOD_OK;
    answer->allowed = true;
    answer->error = finding->error;
    memcpy(answer->position, p, sizeof answer->position);
    memcpy(answer->values, thread->examiner.chosen, size);
    memcpy(answer->errors, thread->examiner.errors, size);
    return exact_pass_on(&thread->examiner, question->working, &answer->passed, error);
}

/* May the star be contracted to a position that is none of those that were asked about? */
static bool may_go(struct thread *thread, const struct question *question, const double p[3])
{
    static const double anywhere[4] = {0.25, 0.25, 0.25, 0.25};
    const struct star *star = question->star;
    return border_allows(question->border, question->working, star->simplex, star->simplex_count, anywhere, p) &&
           border_moves(question->border, question->working, star->simplex, star->simplex_count, p,
                        &thread->map) <= question->border->limit &&
           star_fits(star, question->working, p);
}

/* All positions are refused, this one by the least: goes on from there, each step to where less is needed, until that
 * is allowed or no step is worth making. */
static enum tetlod_status search(struct exact *exact, struct thread *thread, const struct question *question,
                                 const double start[3],
                                 struct answer *answer, struct tetlod_error *error)
{
    struct finding finding;
    double from[3], step[3], p[3], expected, most = CUTOFF * question->limit;
    memcpy(p, start, sizeof p);
    TETLOD_TRY(examine(exact, thread, question, p, most, true, answer, &finding, error));
    for (int steps = 0; steps < MAX_STEPS && !finding.allowed && finding.error < most; steps++) {
        double best = finding.error;
        memcpy(from, p, sizeof from);
        TETLOD_TRY(descent_step(&thread->descent, &thread->examiner, question->border, question->working,
                                question->star, step,
                                &expected, error));
        for (int halving = 0; halving <= HALVINGS && expected < STEP_EXPECTED * question->limit &&
             !(finding.error < best); halving++) {
            for (int i = 0; i < 3; i++)
                p[i] = from[i] + step[i] / (1 << halving);
            working_round(question->working, p);
            if (may_go(thread, question, p))
                TETLOD_TRY(examine(exact, thread, question, p, best, true, answer, &finding, error));
        }
        if (!(finding.error < best))
            break;
        most = STEP_NEEDED * question->limit;
    }
    return TETLOD_OK;
}

/* Keeps the points that refused a position, in `answer->refused`: four numbers each. */
static bool keep_witnesses(struct answer *answer, const struct finding *finding)
{
    bool room = ARRAY_RESERVE(answer->refused.numbers, answer->refused.capacity, answer->refused.count + 8);
    for (int i = 0; i < 2 && room; i++) {
        const struct sentinel *witness = &finding->witness[i];
        uint32_t *numbers = answer->refused.numbers + answer->refused.count;
        numbers[0] = witness->tet;
        numbers[1] = witness->point.ends[0];
        numbers[2] = witness->point.ends[1];
        memcpy(&numbers[3], &witness->point.along, sizeof numbers[3]);
        answer->refused.count += 4;
    }
    return room;
}

static enum tetlod_status exact_ask(void *state, unsigned worker, const struct question *question,
                                    struct answer *answer,
                                    struct tetlod_error *error)
{
    struct exact *exact = state;
    struct thread *thread = &exact->threads[worker];
    double cutoff = (question->named ? CUTOFF : 1) * question->limit, least = INFINITY;
    uint32_t nearest = 0;
    answer->allowed = false;
    answer->too_large = 0;
    TETLOD_TRY(exact_begin(&thread->examiner, question->working, question->star, error));
    for (uint32_t i = 0; i < question->count && !answer->allowed; i++) {
        struct finding finding;
        TETLOD_TRY(examine(exact, thread, question, question->positions[i], cutoff, false, answer, &finding, error));
        if (finding.error < least) {
            least = finding.error;
            nearest = i;
        }
        if (!finding.allowed && !keep_witnesses(answer, &finding))
            return tetlodi_fail_nomem(error, "the exact limit", answer->refused.count * 4);
    }
    if (!answer->allowed && question->named && least < cutoff)
        TETLOD_TRY(search(exact, thread, question, question->positions[nearest], answer, error));
    if (!answer->allowed)
        answer->error = least;
    return TETLOD_OK;
}

static enum tetlod_status exact_take(void *state, const struct star *star, const struct answer *answer,
                                     struct tetlod_error *error)
{
    struct exact *exact = state;
    for (size_t i = 0; i < answer->refused.count; i += 4) {
        const uint32_t *numbers = answer->refused.numbers + i;
        struct sentinel witness = {numbers[0], {{numbers[1], numbers[2]}, 0}};
        memcpy(&witness.point.along, &numbers[3], sizeof numbers[3]);
        overlaps_watch(&exact->overlaps, &witness);
    }
    return answer->allowed ? overlaps_take(&exact->overlaps, star, &answer->passed, error) : TETLOD_OK;
}

static void exact_renumber(void *state, const struct renumbering *numbers)
{
    struct exact *exact = state;
    overlaps_renumber(&exact->overlaps, numbers);
}

enum tetlod_status exact_new(struct limit *limit, const struct tetmesh *mesh, const struct working *working,
                             unsigned threads,
                             struct tetlod_error *error)
{
    struct exact *exact = array_zero(1, sizeof *exact);
    enum tetlod_status status = exact ? TETLOD_OK : tetlodi_fail_nomem(error, "the exact limit", sizeof *exact);
    if (!exact)
        return status;
    exact->threads = array_zero(threads, sizeof *exact->threads);
    exact->thread_count = threads;
    status = exact->threads ? overlaps_init(&exact->overlaps, mesh, working, error)
                            : tetlodi_fail_nomem(error, "the exact limit", threads * sizeof *exact->threads);
    for (unsigned t = 0; t < threads && status == TETLOD_OK; t++)
        status = examiner_init(&exact->threads[t].examiner, working, error);
    if (status != TETLOD_OK) {
        exact_free(exact);
        return status;
    }
    *limit = (struct limit){exact, exact_free, exact_ask, exact_take, exact_renumber, true};
    return TETLOD_OK;
}

uint64_t exact_bytes(uint32_t vertices, uint32_t tets, unsigned threads)
{
    return overlaps_bytes(vertices, tets) + threads * cover_bytes(vertices, tets);
}
