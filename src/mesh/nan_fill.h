/* SPDX-License-Identifier: BSD-3-Clause */
/* Values for points that have none: files say so by NaN (blanked points, sensors that failed). */
#ifndef TETLOD_NAN_FILL_H
#define TETLOD_NAN_FILL_H

#include "src/mesh/tetmesh.h"

enum nan_fill_kind { NAN_FILL_VALUE, NAN_FILL_NEIGHBOURS };

struct nan_fill {
    enum nan_fill_kind kind;
    double value; /* of NAN_FILL_VALUE */
};

/* Gives every component that is NaN the value, or the mean of the point's neighbours that have one, ring by ring from
 * the points that have one: a neighbour is a point at the other end of an edge, and counts once. Where a component of
 * the mesh has no value at all, it stays NaN. Values are rounded to the field's type. Corners are in range. *out_count:
 * how many were filled. O(n), and O(points to fill) for each ring. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status nan_fill(struct tetmesh *mesh, const struct nan_fill *fill, uint64_t *out_count,
                                           struct tetlod_error *error);

#endif
