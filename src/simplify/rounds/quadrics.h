/* SPDX-License-Identifier: BSD-3-Clause */
/* The quadrics of the vertices of a working mesh, one for each component, which order contractions and choose
 * values. */
#ifndef TETLOD_QUADRICS_H
#define TETLOD_QUADRICS_H

#include "src/simplify/rounds/quadric.h"
#include "src/simplify/mesh/working.h"

struct quadrics {
    double origin[3], unit; /* a position's normalised form is (p - origin) / unit */
    /* [slot * components + component] in normalised positions and values; NULL: there are none */
    double (*sums)[QUADRIC_SIZE];
};

/* Of each tetrahedron's share, weighted by its volume: the field's own, or with `distance` the generalised ones of
 * Garland and Heckbert. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status quadrics_init(struct quadrics *quadrics, const struct working *working, bool distance,
                                                struct tetlod_error *error);
void quadrics_fini(struct quadrics *quadrics);

/* A component's quadric of a simplex: the sum of its vertices'. */
void quadrics_of(const struct quadrics *quadrics, const struct working *working, const uint32_t *simplex,
                 uint32_t count,
                 uint32_t component, double out[QUADRIC_SIZE]);

/* p normalised. */
void quadrics_place(const struct quadrics *quadrics, const double p[3], double out[3]);

/* The position where the quadrics of all components add up to the least for a simplex. False: there is no single
 * one. */
bool quadrics_optimum(const struct quadrics *quadrics, const struct working *working, const uint32_t *simplex,
                      uint32_t count,
                      double p[3]);

void quadrics_renumber(struct quadrics *quadrics, const struct working *working, const struct renumbering *numbers);

/* The last vertex of the simplex gets the sums. */
void quadrics_contract(const struct quadrics *quadrics, const struct working *working, const uint32_t *simplex,
                       uint32_t count);

#endif
