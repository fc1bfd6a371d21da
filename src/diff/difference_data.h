/* SPDX-License-Identifier: BSD-3-Clause */
/* What is compared, and what is found (difference.h). */
#ifndef TETLOD_DIFFERENCE_DATA_H
#define TETLOD_DIFFERENCE_DATA_H

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

#endif
