/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * How far two results differ at places of the originals that a level's boundary has left, or has come back to. The
 * partner of such a place is on that boundary, and its partners in the two levels are no further apart than both
 * boundaries have moved (PROOF.md 14). So the faces of each boundary are compared with the tetrahedra of the other
 * level that are no further away.
 */
#ifndef TETLOD_BOUNDARY_SHELL_H
#define TETLOD_BOUNDARY_SHELL_H

#include "src/diff/moved_boundary.h"

/* All is borrowed. */
struct boundary_shell_side {
    const struct tetmesh *mesh;
    const struct moved_boundary *boundary;
    const uint8_t *usable;  /* [tet] */
    const double *values;   /* [stride * vertex] */
};

/* The largest difference of the levels' values, over pairs of partners of such places, or `most`, if that is larger:
 * then it is found sooner. The same on any number of threads. */
double boundary_shell_difference(const struct boundary_shell_side sides[2], uint32_t stride, uint32_t components,
                                 double most, unsigned threads);

#endif
