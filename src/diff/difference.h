/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The difference of a field on two meshes, each of which is off its original by a known bound (PROOF.md 14).
 *
 * The meshes are laid over each other: where a tetrahedron of one and one of the other overlap, in a cell, the
 * difference of the fields is linear. There the originals' difference lies within the two bounds of it. So each cell
 * encloses the originals' largest difference and their square's integral. A cell of less than a hundredth of the
 * smaller tetrahedron is a sliver: rounding of positions may have made it, so that it does not count for what is there
 * at least. Cells thinner than 1e-9 of a tetrahedron's height are contacts.
 *
 * Where a boundary has moved, only places that are further from it count for what is there at least
 * (moved_boundary.h), and places that it has left are compared apart (boundary_shell.h).
 *
 * Bodies, the parts that share no vertex, are compared with those that they are in the other mesh (bodies.h).
 * Tetrahedra that are degenerate, inverted or folded have no promise, and are left out.
 */
#ifndef TETLOD_DIFFERENCE_H
#define TETLOD_DIFFERENCE_H

#include "src/diff/difference_data.h"

/* `component`: one of the field's, or -1: all. Both fields have as many. The same on any number of threads. ERR_NOMEM.
 * To be released, also after a failure. */
TETLOD_CHECKED enum tetlod_status difference_measure(struct difference *out, const struct difference_side sides[2],
                                                     int component, const struct difference_open *open,
                                                     unsigned threads, struct tetlod_error *error);
void difference_fini(struct difference *difference);

#endif
