/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The state of a run of contractions, and the evaluation of a simplex in it: may the simplex be contracted within the limit, where to, and
 * with which key. An evaluation changes the evaluator only, and each thread has one.
 */
#ifndef TETLOD_EVALUATOR_H
#define TETLOD_EVALUATOR_H

#include "src/simplify/exact/descent.h"
#include "src/simplify/entry.h"
#include "src/simplify/exact/exact.h"
#include "src/simplify/samples.h"
#include "src/simplify/simplify.h"
#include "src/simplify/waiting_list.h"

/* What evaluating a simplex needs: one a thread. */
struct evaluator {
    struct star star;
    struct metric_scratch scratch;
    struct examiner examiner; /* of the exact limit */
    struct descent descent;   /* of the same */
    struct sampler sampler; /* of the measured metric */
    struct boundary_map map;
    struct trial trials[MOST_TRIALS]; /* the star's, after evaluator_try_all */
    uint32_t trial_count;
    uint64_t refused[LOG_REFUSALS];
    struct tetlod_error error;
    enum tetlod_status status;
};

/* A simplex of a batch, which the exact limit is asked about. */
struct batch_entry {
    struct queue_entry entry;
    enum { FILED, REFUSED, ALLOWED } outcome; /* it has a key; it waits; it may be contracted, as far as the error goes */
    double position[3];                       /* if it is allowed */
    double *values, *errors;                  /* [driver_count] */
    struct sentinel witnesses[8];             /* points that refused candidates */
    uint32_t witness_count;
    struct passed passed;                 /* of what is allowed */
};

/* So many are examined at a time at most, on as many threads as there are; fewer where as many others are in their way. */
enum { BATCH = 128, POSTPONED = 64 };

struct run {
    const struct simplify_options *options;
    struct complex *complex;
    struct fields *fields;
    struct boundary boundary;
    struct overlaps overlaps; /* of the exact limit */
    struct samples samples; /* of the measured metric */
    struct evaluator *evaluators; /* [crew_size]; the first is the one that contracts */
    struct crew *crew;    /* one evaluator each */
    struct queue queue;
    struct waiting_list waiting;
    struct queue_entry last;    /* that was listed after a contraction */
    struct queue fresh;         /* simplices that are to be evaluated */
    struct batch_entry *batch_entries;         /* [BATCH] */
    double batch_key;           /* the least in the queue behind the batch */
    uint32_t batch;             /* its number */
    uint32_t *claims;           /* [slot] the last batch that had a star with it; scratch of take_batch */
    struct queue_entry postponed[POSTPONED]; /* of the same */
    double *batch_values;        /* [BATCH][2][driver_count] values and errors */
    double limit;               /* of the current rung */
    double moved;               /* running maximum of how far the boundary moved */
    bool named;                 /* levels are named after it */
    double most_expected;       /* the exact limit is not asked where an estimate is above this multiple of the limit */
    double *certified, *predicted; /* [driver_count] running maxima */
    double *assigned;              /* [driver_count] of the contraction at hand, as is its outcome */
    struct outcome *outcome;
    uint32_t *link, *unfrozen;
    size_t link_capacity, unfrozen_capacity;
    struct tetlod_error *error;
};

static inline bool is_exact(const struct run *run)
{
    return run->options->certify == CERTIFY_EXACT;
}

/* May the simplex be contracted at all? Frozen vertices only with vertices at the same point, under the envelope: that needs no
 * interpolant (PROOF.md, 6). */
bool may_be_contracted(const struct run *run, const struct queue_entry *entry);

/* Evaluates a simplex as it is now. *out_allowed: the limit allows it, and entry->value is its key; else it is a lower bound
 * of its error. The entry's witnesses are asked first. */
TETLOD_CHECKED enum tetlod_status evaluate_simplex(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry,
                                                 bool *out_allowed);

/* Tries all candidates on the evaluator's star. What the entry refuses stays so. */
TETLOD_CHECKED enum tetlod_status evaluator_try_all(const struct run *run, struct evaluator *evaluator, struct queue_entry *entry);

/* The best of those that the entry does not refuse: returns its error (INFINITY: none is possible; above the limit: a lower bound);
 * its key is in entry->value. */
double evaluator_best(const struct run *run, const struct evaluator *evaluator, struct queue_entry *entry);

/* Where the entry's candidate is on the evaluator's star, and how far the boundary then has moved in all, by evaluator->map. False: it cannot
 * be had. */
bool evaluator_place(const struct run *run, struct evaluator *evaluator, const struct queue_entry *entry, double p[3], double *moved);

/* Errors of trials on the evaluator's star, followed up to `most`. */
TETLOD_CHECKED enum tetlod_status evaluator_try(const struct run *run, struct evaluator *evaluator, const struct boundary_map *map,
                                            double most, struct trial *trials, uint32_t count);

/* The values that they have assigned to the drivers at the first of them. */
void evaluator_assigned(const struct run *run, const struct evaluator *evaluator, double *values);

#endif
