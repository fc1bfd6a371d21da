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

#include "src/diff/moved_boundary.h"
#include "src/mesh/tetmesh.h"

/* A mesh with the field, and what its values are off the original's at most. All is borrowed. */
struct difference_side {
    const struct tetmesh *mesh;
    uint32_t field, bound; /* of the mesh; bound: a field that bounds the error at each point, or TETLOD_NONE */
    double error;          /* at any point, in the field's units */
    double moved;          /* how far the boundary has moved at most */
    double swept;          /* the volume that it has swept; infinite if that is not known */
    bool has_partners;     /* the error is one at the partners of places that the boundary has left, too */
    double range[2];       /* of the original's values */
};

/* In one tetrahedron of the first mesh; of the largest component. */
struct difference_cell {
    double volume;       /* that the second mesh covers */
    double integral;     /* of the first component's difference, first less second */
    double lower, upper; /* of the largest difference in it: somewhere at least, everywhere at most */
    double squares[2];   /* integral of the square, over all components: at least, at most */
    bool left;           /* boundaries have left places of it: there `shell` is the upper end */
};

struct difference {
    struct difference_cell *cells; /* owned, [tets of the first mesh] */
    double volumes[2], overlap;    /* of the meshes' tetrahedra that count, and of what both cover */
    double apart;                  /* of what is in both, in bodies that are not each other's */
    double max[2], squares[2];     /* of the whole overlap: at least, at most */
    double inner;                  /* the greatest upper end of a cell */
    double place[3];               /* where the largest difference is at least that */
    double shell;                  /* at most, at places that boundaries have left; 0: there are none */
    double swept;                  /* the volume that both boundaries have swept at most */
    uint64_t left_out[2];          /* tetrahedra without a promise */
    struct moved_boundary boundaries[2];
    bool one_body;                 /* each of both */
    bool decided;                  /* a difference is above the limit that was open: the rest was not compared */
};

/* What is open: which tetrahedra of the first mesh are compared at all, to find out whether a difference is above the
 * limit. Of pairs that certainly differ by less only that is found, not how much, nor their volume. */
enum difference_asked { ASKED_NOT, ASKED_LAST, ASKED_FIRST };
struct difference_open {
    uint8_t *asked; /* [tet] when: not if those before have decided. NULL: all, with all that there is to know */
    double limit;
};

/* `component`: one of the field's, or -1: all. Both fields have as many. The same on any number of threads. ERR_NOMEM.
 * To be released, also after a failure. */
TETLOD_CHECKED enum tetlod_status difference_measure(struct difference *out, const struct difference_side sides[2],
                                                     int component, const struct difference_open *open,
                                                     unsigned threads, struct tetlod_error *error);
void difference_fini(struct difference *difference);

#endif
