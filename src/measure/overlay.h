/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The true largest difference of two piecewise linear fields on two meshes of the same domain. On the intersection of two
 * tetrahedra it is linear, so it is largest at a corner of it: an end of an edge of the one clipped to the other.
 *
 * Degenerate tetrahedra have no interpolant and are skipped. Where b covers a place more than once (it overlaps itself), the
 * best of its values counts at each corner of the overlay. Intersections thinner than 1e-9 of a tetrahedron's height are contacts, not overlap:
 * on either side of a face across which both fields jump, each is compared with its own side. What b does not cover is not
 * looked at.
 */
#ifndef TETLOD_OVERLAY_H
#define TETLOD_OVERLAY_H

#include "src/mesh/tetmesh.h"

struct overlay_report {
    uint64_t cells;         /* pairs of tetrahedra that overlap */
    uint64_t degenerate[2]; /* tetrahedra of a and of b without an interpolant */
};

/* out[i]: the largest |field a_fields[i] of a - field b_fields[i] of b| over its components and the common domain, in the
 * field's units, i < count. The result does not depend on `threads`. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status overlay_max(const struct tetmesh *a, const uint32_t *a_fields,
                                              const struct tetmesh *b, const uint32_t *b_fields, uint32_t count,
                                              unsigned threads, double *out, struct overlay_report *report,
                                              struct tetlod_error *error);

#endif
