/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A field while the mesh is contracted: how its values are kept and rounded. Values far from zero are kept less the
 * middle of their range, which is exact, so that rounding is about what varies (PROOF.md, 4).
 */
#ifndef TETLOD_FIELD_H
#define TETLOD_FIELD_H

#include "src/mesh/tetmesh.h"

struct working_field {
    uint32_t components;
    enum tetlod_type type;
    double *middles;              /* [components] what all numbers here, but not the log's, are less */
    double (*component_range)[2]; /* [components] of the original: assigned values stay inside */
    struct grid grid;
    bool is_ids;                  /* a contraction takes one of its vertices' values */
};

/* A round value is no further from the best one than this part of the error that it may have. */
enum { CHEAP_PART = 8 };

/* A value that costs few bits (SPEC 8) among those from `least` to `greatest`: the first of those that are free, what a
 * vertex at the same place has or the mean of two that the place is in the middle of; else the roundest of the grid
 * within `slack` of `middle`. */
double field_cheap(const struct working_field *field, uint32_t component, const double *free_values, uint32_t count,
                   double middle,
                   double least, double greatest, double slack);

/* What a component's values are kept less: nothing, unless all of them are so far from zero that no more than a factor
 * of two is between any two of them and their middle. Then the differences are exact (Sterbenz). */
double field_middle(const double range[2]);

/* s, less the component's middle, as the field's type can hold it in the component's range. */
double field_round(const struct working_field *field, uint32_t component, double value);

#endif
