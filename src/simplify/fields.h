/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The fields while the complex is contracted: the current value of every component at every slot, and what is known of the
 * error of those that drive it. A driver is one component of a controlled field; U >= psi_0 >= L is its envelope
 * (PROOF.md), `predicted` the thesis's accumulated error (4.1, 4.2.3). Values far from zero are kept less the middle of their
 * range, which is exact, so that rounding is about what varies (PROOF.md, 4).
 */
#ifndef TETLOD_FIELDS_H
#define TETLOD_FIELDS_H

#include "src/simplify/boundary_map.h"
#include "src/simplify/complex.h"
#include "src/simplify/quadric.h"

/* The interpolants of L and U in a tetrahedron: their values at its first corner, and their gradients. */
struct envelope {
    double value[2], gradient[2][3];
};

struct driver {
    uint32_t field, component;
    double scale;  /* 1 / the field's range; 0 for a constant field */
    double weight; /* its error counts this many times against the limit: 1, or limit of all / limit of the field */
    double *upper, *lower; /* [slot] */
    double *predicted;     /* [slot] in the field's units */
    double *quadrics;      /* [QUADRIC_SIZE * slot] in normalised positions and values, or NULL */
    struct envelope *envelopes; /* [tet], kept by the metric, or NULL */
};

struct working_field {
    uint32_t components;
    enum tetlod_type type;
    double *middles;              /* [components] what all numbers here, but not the log's, are less */
    double (*component_range)[2]; /* [components] of the original: assigned values stay inside */
    double *values;               /* [components * slot] */
    struct grid grid;
    bool is_ids;                  /* a contraction takes one of its vertices' values */
};

struct fields {
    double origin[3], unit; /* a position's normalised form is (p - origin) / unit */
    uint32_t count, driver_count;
    struct working_field *fields;
    struct driver *drivers;
};

/* `controlled` lists `controlled_count` field indices of the mesh; `limits` (may be NULL) their own error limits as
 * multiples of the common one. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status fields_init(struct fields *fields, const struct tetmesh *mesh,
                                              const uint32_t *controlled, uint32_t controlled_count,
                                              const double *limits, struct tetlod_error *error);
void fields_fini(struct fields *fields);

/* Gives every driver its quadrics: the field's own, or with `distance` the generalised ones of Garland and Heckbert. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status fields_init_quadrics(struct fields *fields, const struct complex *complex,
                                                       bool distance, struct tetlod_error *error);

/* A driver's quadric of the star's simplex: the sum of its vertices'. */
void driver_quadric(const struct driver *driver, const struct star *star, double out[QUADRIC_SIZE]);

void normalise_position(const struct fields *fields, const double p[3], double out[3]);

/* Bytes that the fields of a mesh take while it is contracted, about. */
uint64_t fields_bytes(const struct tetmesh *mesh, uint32_t controlled_count);

/* What a contraction would make of a driver. */
struct outcome {
    double value, upper, lower, predicted;
};

/* The outcome of contracting a star to p, which maps its boundary so, for every driver, with rigorous bounds. `assigned` is its metric's
 * value, or NaN for scalar value assignment. */
void fields_outcome(const struct fields *fields, const struct complex *complex, const struct star *star,
                    const struct boundary_map *map, const double p[3], const double *assigned, struct outcome *out);

/* A round value is no further from the best one than this part of the error that it may have. */
enum { CHEAP_PART = 8 };

/* A value that costs few bits (SPEC 8) among those from `least` to `greatest`: the first of those that are free, what a vertex at the
 * same place has or the mean of two that the place is in the middle of; else the roundest of the grid within `slack` of `middle`. */
double field_cheap(const struct working_field *field, uint32_t component, const double *free_values, uint32_t count, double middle,
                   double least, double greatest, double slack);

/* Gives every driver a value that costs few bits and whose error is no larger than errors[driver], a fraction of its range, or than it
 * is: what the sequence has come to already. */
void fields_cheapen(const struct fields *fields, const struct complex *complex, const struct star *star, const double p[3],
                    const double *errors, struct outcome *outcome);

/* The worst weighted error of an outcome, as a fraction of the range. */
double outcome_error(const struct fields *fields, const struct outcome *outcome);

/* Makes it so, before complex_contract, and logs it; what does not drive is assigned by scalar value assignment (thesis 3.3). */
void fields_contract(struct fields *fields, const struct complex *complex, const struct star *star, const double p[3],
                     const struct outcome *outcome);

/* Takes over new numbers of tetrahedra and slots. */
void fields_renumber(struct fields *fields, const struct renumbering *tets, const struct renumbering *slots);

/* What a component's values are kept less: nothing, unless all of them are so far from zero that no more than a factor of two is
 * between any two of them and their middle. Then the differences are exact (Sterbenz). */
double field_middle(const double range[2]);

/* s, less the component's middle, as the field's type can hold it in the component's range. */
double field_round(const struct working_field *field, uint32_t component, double value);

#endif
