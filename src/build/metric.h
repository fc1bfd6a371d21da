/* SPDX-License-Identifier: BSD-3-Clause */
/* What a contraction costs: the error that is limited, and the key that orders. */
#ifndef TETLOD_METRIC_H
#define TETLOD_METRIC_H

#include "src/build/candidates.h"
#include "src/build/fields.h"

enum metric {
    METRIC_ENVELOPE, /* error: the certified envelope's; key: error / removed^1.5 */
    METRIC_SVA,      /* error and key: the thesis's accumulated prediction */
};

/* A final vertex position that is tried. */
struct trial {
    double position[3];
    bool possible; /* in: worth trying; out: no re-attached tetrahedron flips there (nearly exact: star_fits decides) */
    double error;  /* out: fraction of the range, of the worst weighted driver; above the limit: a lower bound of it */
    uint32_t witness[2]; /* out: while these tetrahedra stay as they are, it stays impossible, or its error that great */
};

/* Least and greatest value at a trial, and the tetrahedra whose interpolants say so. */
struct metric_bounds {
    double value[2];
    uint32_t tet[2];
};

struct metric_scratch {
    struct metric_bounds *bounds; /* [driver * MOST_CANDIDATES] */
};

TETLOD_CHECKED enum tetlod_status metric_init(struct metric_scratch *scratch, const struct fields *fields,
                                              struct tetlod_error *error);
void metric_fini(struct metric_scratch *scratch);

/* Tries positions on a gathered star. One pass over its tetrahedra that ends as soon as every trial is impossible or above
 * the limit, as most are. */
void metric_try(enum metric metric, struct metric_scratch *scratch, const struct fields *fields,
                const struct complex *complex, const struct star *star, double limit, struct trial *trials,
                uint32_t count);

/* The values that the metric assigned to the drivers at a trial of the last metric_try; NaN: scalar value assignment. */
void metric_assigned(enum metric metric, const struct metric_scratch *scratch, const struct fields *fields,
                     uint32_t trial, double *out);

/* What orders contractions of that error. */
double metric_key(enum metric metric, double error, uint32_t removed);

#endif
