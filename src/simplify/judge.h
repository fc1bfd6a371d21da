/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A run of contractions as it stands, and what it says of a simplex: may it be contracted within the limit, to what, and at what key.
 * Judging changes nothing but the judge, of which each thread has one.
 */
#ifndef TETLOD_JUDGE_H
#define TETLOD_JUDGE_H

#include "src/simplify/exact/descent.h"
#include "src/simplify/entry.h"
#include "src/simplify/exact/exact.h"
#include "src/simplify/samples.h"
#include "src/simplify/simplify.h"
#include "src/simplify/waiting_list.h"

/* What evaluating a simplex needs: one a thread. */
struct judge {
    struct star star;
    struct metric_scratch scratch;
    struct examiner examiner; /* of the exact limit */
    struct descent descent;   /* of the same */
    struct sampler sampler; /* of the measured metric */
    struct boundary_map map;
    struct trial trials[MOST_TRIALS]; /* the star's, after judge_try_all */
    uint32_t trial_count;
    uint64_t refused[LOG_REFUSALS];
    struct tetlod_error error;
    enum tetlod_status status;
};

/* A simplex whose turn has come under the exact limit. */
struct work {
    struct queue_entry entry;
    enum { FILED, REFUSED, ALLOWED } outcome; /* it has a key; it waits; it may be contracted, as far as the error goes */
    double position[3];                       /* if it is allowed */
    double *values, *errors;                  /* [driver_count] */
    struct sentinel witnesses[8];             /* points that refused candidates */
    uint32_t witness_count;
    struct handover handover;                 /* of what is allowed */
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
    struct judge *judges; /* [crew_size]; the first is the one that contracts */
    struct crew *crew;    /* one judge each */
    struct queue queue;
    struct waiting_list waiting;
    struct queue_entry last;    /* that was listed after a contraction */
    struct queue fresh;         /* simplices that are to be evaluated */
    struct work *works;         /* [BATCH] */
    double batch_key;           /* the least in the queue behind the batch */
    uint32_t batch;             /* its number */
    uint32_t *claims;           /* [slot] the last batch that had a star with it; scratch of take_batch */
    struct queue_entry postponed[POSTPONED]; /* of the same */
    double *work_values;        /* [BATCH][2][driver_count] values and errors */
    double limit;               /* of the current rung */
    double moved;               /* running maximum of how far the boundary moved */
    bool named;                 /* levels are named after it */
    double chance;              /* what the estimate of an error may be above it to have a chance under the exact limit */
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
bool judge_may(const struct run *run, const struct queue_entry *entry);

/* Evaluates a simplex as it is now. *out_allowed: the limit allows it, and entry->value is its key; else it is a lower bound
 * of its error. The entry's witnesses are asked first. */
TETLOD_CHECKED enum tetlod_status judge_evaluate(const struct run *run, struct judge *judge, struct queue_entry *entry,
                                                 bool *out_allowed);

/* Tries all candidates on the judge's star. What the entry refuses stays so. */
TETLOD_CHECKED enum tetlod_status judge_try_all(const struct run *run, struct judge *judge, struct queue_entry *entry);

/* The best of those that the entry does not refuse: returns its error (INFINITY: none is possible; above the limit: a lower bound);
 * its key is in entry->value. */
double judge_best(const struct run *run, const struct judge *judge, struct queue_entry *entry);

/* Where the entry's candidate is on the judge's star, and how far the boundary then has moved in all, by judge->map. False: it cannot
 * be had. */
bool judge_place(const struct run *run, struct judge *judge, const struct queue_entry *entry, double p[3], double *moved);

/* Errors of trials on the judge's star, followed up to `most`. */
TETLOD_CHECKED enum tetlod_status judge_try(const struct run *run, struct judge *judge, const struct boundary_map *map,
                                            double most, struct trial *trials, uint32_t count);

/* The values that they have assigned to the drivers at the first of them. */
void judge_assigned(const struct run *run, const struct judge *judge, double *values);

#endif
