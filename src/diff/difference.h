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
 * Bodies, the parts that share no vertex, are compared with those that they are in the other mesh (bodies.h).
 * Tetrahedra that are degenerate, inverted or folded have no promise, and are left out.
 */
#ifndef TETLOD_DIFFERENCE_H
#define TETLOD_DIFFERENCE_H

#include "src/mesh/tetmesh.h"

/* A mesh with the field, and what its values are off the original's at most. All is borrowed. */
struct difference_side {
    const struct tetmesh *mesh;
    uint32_t field, bound; /* of the mesh; bound: a field that bounds the error at each point, or TETLOD_NONE */
    double error;          /* at any point, in the field's units */
    double swept;          /* the volume that the boundary has swept */
};

/* In one tetrahedron of the first mesh; of the largest component. */
struct difference_cell {
    double volume;       /* that the second mesh covers */
    double integral;     /* of the first component's difference, first less second */
    double lower, upper; /* of the largest difference in it: somewhere at least, everywhere at most */
    double squares[2];   /* integral of the square, over all components: at least, at most */
};

struct difference {
    struct difference_cell *cells; /* owned, [tets of the first mesh] */
    double volumes[2], overlap;    /* of the meshes' tetrahedra that count, and of what both cover */
    double apart;                  /* of what is in both, in bodies that are not each other's */
    double max[2], squares[2];     /* of the whole overlap: at least, at most */
    double place[3];               /* where the largest difference is at least that */
    double differing;              /* the largest difference that more than the swept volumes have */
    uint64_t left_out[2];          /* tetrahedra without a promise */
};

/* `component`: one of the field's, or -1: all. Both fields have as many. The same on any number of threads. ERR_NOMEM.
 * To be released, also after a failure. */
TETLOD_CHECKED enum tetlod_status difference_measure(struct difference *out, const struct difference_side sides[2],
                                                     int component, unsigned threads, struct tetlod_error *error);
void difference_fini(struct difference *difference);

#endif
