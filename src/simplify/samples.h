/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The true error at samples of the original, while the complex is contracted: the points of sample_points.h (every original vertex,
 * and some inside every tetrahedron that is not degenerate). Each tetrahedron lists the samples in it; a contraction sorts
 * those of the old star into the new one. At a sample x of the new star the new value is w s' + K, w being the weight of the
 * new vertex and K what the link's vertices give: its error is at most e where s' is in an interval, and the best s' is found
 * by least squares within all of them.
 */
#ifndef TETLOD_SAMPLES_H
#define TETLOD_SAMPLES_H

#include "src/simplify/fields.h"
#include "src/simplify/metric.h"

struct samples {
    uint32_t count, stride;
    double *rows;    /* [stride * sample] position, the drivers' original values */
    uint32_t *first; /* [tet] a sample in it, or TETLOD_NONE */
    uint32_t *next;  /* [sample] another one in the same tetrahedron, or TETLOD_NONE */
    uint32_t *held;  /* [tet] how many it has */
};

/* ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status samples_init(struct samples *samples, const struct tetmesh *mesh,
                                               const struct complex *complex, const struct fields *fields,
                                               struct tetlod_error *error);
void samples_fini(struct samples *samples);
uint64_t samples_bytes(const struct tetmesh *mesh, uint32_t driver_count);

/* One thread's scratch: the new star at each trial, and the samples in it. */
struct sampler {
    struct attempt *attempts; /* [MOST_TRIALS] */
    struct demand *demands;   /* [driver_count * MOST_TRIALS] */
    double *assigned;         /* [driver * MOST_TRIALS] */
    struct cone *cones;       /* [star's tetrahedra * trial] */
    struct held *held;        /* the samples looked at, where they are at the first trial */
    double *parts;            /* [part_count * held] for each trial and driver w, and K minus the original value */
    size_t held_count, part_count, cone_capacity, held_capacity, part_capacity;
};

TETLOD_CHECKED enum tetlod_status sampler_init(struct sampler *sampler, const struct fields *fields,
                                               struct tetlod_error *error);
void sampler_fini(struct sampler *sampler);

/* As metric_try does, for the true error at the samples. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status samples_try(const struct samples *samples, struct sampler *sampler,
                                              const struct complex *complex, const struct fields *fields,
                                              const struct star *star, double limit, double cutoff,
                                              struct trial *trials, uint32_t count, struct tetlod_error *error);

/* The drivers' values at a trial of the last samples_try; NaN: scalar value assignment. */
void samples_assigned(const struct sampler *sampler, const struct fields *fields, uint32_t trial, double *out);

/* Sorts the samples of the star into its new tetrahedra after a samples_try of one trial, which was within the limit. */
void samples_contract(struct samples *samples, const struct sampler *sampler, const struct fields *fields,
                      const struct star *star, double error);

#endif
