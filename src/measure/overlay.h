/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The true largest difference of two piecewise linear fields on two meshes of the same domain. On the intersection of
 * two tetrahedra it is linear, so it is largest at a corner of it: an end of an edge of the one clipped to the other.
 *
 * Doubles, with a bound of their rounding, rule out the pairs that cannot be above what was found already; what is left
 * is clipped in 113 bits (exact_cell.h). So the result is the largest difference to the last digits of a double.
 *
 * Degenerate tetrahedra have no interpolant and are skipped. Where b covers a place more than once (it overlaps
 * itself), the best of its values counts at each corner of the overlay. Intersections thinner than 1e-9 of a
 * tetrahedron's height are contacts, not overlap: on either side of a face across which both fields jump, each is
 * compared with its own side. What b does not cover is not looked at.
 */
#ifndef TETLOD_OVERLAY_H
#define TETLOD_OVERLAY_H

#include "src/measure/clusters.h"
#include "src/mesh/tetmesh.h"

struct overlay_report {
    uint64_t cells;         /* pairs of tetrahedra that overlap, as far as they had to be looked at */
    uint64_t degenerate[2]; /* tetrahedra of a and of b without an interpolant */
};

/* What is known of the meshes. All may be left 0. */
struct overlay_options {
    unsigned threads;          /* the result does not depend on it */
    const uint32_t *bodies[2]; /* [vertex] each body is compared with that of the same number only; NULL: with all */
    const uint8_t *usable[2];  /* [tet] 0: left out as degenerate ones are; NULL: none */
    const uint8_t *wanted;     /* [tet of b] 0: the differences in it are known; NULL: none */
    /* of all tetrahedra of a (borrowed), to be asked several times; NULL: made where they are needed */
    const struct clusters *clusters;
    /* b may overlap itself: tetrahedra of a whose differences are small on one sheet of it are found quickly */
    bool overlaps;
    const uint32_t *neighbours; /* of b, as adjacency_build makes them (borrowed); NULL: made if b overlaps itself */
    const double *floors;      /* [count] in the field's units: differences up to that are not looked for; NULL: 0 */
    /* [tet of b][count] of each tetrahedron its own: a floor, raised to a bound of the differences in it; NULL: none.
     * Also where b covers a place more than once; `floors` and the results do not count then */
    double *each;
};

/* out[i]: the largest |field a_fields[i] of a - field b_fields[i] of b| over its components and the common domain, in
 * the field's units, i < count; at least the floor. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status overlay_max(const struct tetmesh *a, const uint32_t *a_fields,
                                              const struct tetmesh *b, const uint32_t *b_fields, uint32_t count,
                                              const struct overlay_options *options, double *out,
                                              struct overlay_report *report, struct tetlod_error *error);

/* Memory that it takes on one thread, at most, of meshes with so many tetrahedra, where b does not overlap itself. */
uint64_t overlay_bytes(uint32_t a_tets, uint32_t b_tets);

#endif
