/* SPDX-License-Identifier: BSD-3-Clause */
/* Rounds a mesh to grids before it is contracted, so that every error includes it. */
#ifndef TETLOD_QUANTISE_H
#define TETLOD_QUANTISE_H

#include "src/mesh/tetmesh.h"

enum { QUANTISE_MAX_BITS = 30 };

/* Bits of each coordinate across the bounds and of each value across its field's range; where they are 0, as many as
 * keep the error within a fraction of the diagonal and of the range; where that is 0 as well, none: lossless. */
struct quantise_options {
    unsigned position_bits, field_bits;
    double position_error, field_error;
};

bool quantise_wanted(const struct quantise_options *options);
bool quantise_rounds_fields(const struct quantise_options *options);

/* A copy of the mesh on its grids. ERR_ARGUMENT if an error would need more than 30 bits, ERR_NOMEM. On failure *out is
 * empty. */
TETLOD_CHECKED enum tetlod_status quantise_mesh(struct tetmesh *out, const struct tetmesh *mesh,
                                                const struct quantise_options *options, struct tetlod_error *error);

/* Values of cells on multiples of a quantum: as many bits as `options` ask for across the field's range. */
struct rounded_cells {
    double *values; /* owned; NULL: they stay exact, because they are not all finite, or because floats are no finer */
    double quantum, error; /* error: the most that a value changed by */
};

/* Rounds a field of floats, of `rows` rows, where fields are rounded at all. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status quantise_cells(const struct point_field *field, size_t rows, bool single,
                                                 const struct quantise_options *options, struct rounded_cells *out,
                                                 struct tetlod_error *error);

/* The largest distance that rounding has moved a vertex: no point of the boundary has moved further. */
double quantise_moved(const struct tetmesh *copy, const struct tetmesh *mesh);

/* out[field]: a bound of |field of the copy - field of the mesh| over the domain, at most the range. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status quantise_bounds(const struct tetmesh *copy, const struct tetmesh *mesh,
                                                  unsigned threads,
                                                  double *out, struct tetlod_error *error);

#endif
