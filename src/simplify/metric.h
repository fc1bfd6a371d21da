/* SPDX-License-Identifier: BSD-3-Clause */
/* What a contraction costs: the error that is limited, and the key that orders. */
#ifndef TETLOD_METRIC_H
#define TETLOD_METRIC_H

#include "src/simplify/candidates.h"
#include "src/simplify/fields.h"

enum metric {
    METRIC_ENVELOPE, /* error: the certified envelope's; key: error / removed^1.5 */
    METRIC_SVA,      /* error and key: the thesis's accumulated prediction */
    METRIC_FIELD_QUADRIC, /* error: the envelope's; key: field quadric / removed^2; the value is the quadric's best */
    METRIC_QUADRIC,       /* the same with Garland and Heckbert's generalised quadric */
    METRIC_MEASURED,      /* error: the true one at samples (samples.h); key: error / removed^1.5 */
};

/* Do its contractions have an optimal position of their own? */
static inline bool metric_has_quadrics(enum metric metric)
{
    return metric == METRIC_FIELD_QUADRIC || metric == METRIC_QUADRIC;
}

/* Is a contraction within the limit only if its certified error is? */
static inline bool metric_is_certified(enum metric metric)
{
    return metric != METRIC_SVA && metric != METRIC_MEASURED;
}

/* A final vertex position that is tried. */
struct trial {
    double position[3];
    bool possible; /* in: worth trying; out: no re-attached tetrahedron flips there (nearly exact: star_fits decides) */
    double error;  /* out: fraction of the range, of the worst weighted driver; above the limit: a lower bound of it; without a
                      limit, and with quadrics, an estimate: the root of their mean */
    double cost;   /* out: the quadric's least value at the position, where the metric has quadrics */
    uint32_t witness[2]; /* out: while these tetrahedra stay as they are, it stays impossible, or its error that great */
};

/* Least and greatest value at a trial, and the tetrahedra whose interpolants say so. */
struct metric_bounds {
    double value[2];
    uint32_t tet[2];
    double assigned; /* the value given to the driver; NaN: scalar value assignment */
};

/* Gives the drivers their envelopes, which trials that have a limit need. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status metric_init_envelopes(enum metric metric, struct fields *fields,
                                                        const struct complex *complex, struct tetlod_error *error);

/* Brings the envelopes in a contraction's new star up to date. */
void metric_update_envelopes(enum metric metric, struct fields *fields, const struct complex *complex, uint32_t vertex);

struct metric_scratch {
    struct metric_bounds *bounds; /* [driver * MOST_CANDIDATES] */
};

TETLOD_CHECKED enum tetlod_status metric_init(struct metric_scratch *scratch, const struct fields *fields,
                                              struct tetlod_error *error);
void metric_fini(struct metric_scratch *scratch);

/* Tries positions on a gathered star. One pass over its tetrahedra that ends as soon as every trial is impossible or above
 * the limit, as most are. With a map of the boundary (may be NULL), the bounds are also what it demands. */
void metric_try(enum metric metric, struct metric_scratch *scratch, const struct fields *fields,
                const struct complex *complex, const struct star *star, const struct boundary_map *map, double limit,
                struct trial *trials, uint32_t count);

/* Raises the error of a trial of the last metric_try, and its lower bound, to what the map of its boundary demands. */
void metric_demand(const struct metric_scratch *scratch, const struct fields *fields, const struct boundary_map *map,
                   uint32_t trial, double *io_error);

/* The values that the metric assigned to the drivers at a trial of the last metric_try; NaN: scalar value assignment. */
void metric_assigned(const struct metric_scratch *scratch, const struct fields *fields, uint32_t trial, double *out);

/* The position where the drivers' quadrics of the star's simplex add up to the least. False: there is no single one. */
bool metric_optimum(const struct fields *fields, const struct star *star, double p[3]);

/* What orders contractions. */
double metric_key(enum metric metric, const struct trial *trial, uint32_t removed);

#endif
