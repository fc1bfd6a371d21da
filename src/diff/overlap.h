/* SPDX-License-Identifier: BSD-3-Clause */
/* Where a tetrahedron of one mesh and one of the other overlap: what the difference is there. */
#ifndef TETLOD_OVERLAP_H
#define TETLOD_OVERLAP_H

#include <math.h>

#include "src/ask/clip.h"
#include "src/diff/bodies.h"
#include "src/diff/difference_data.h"
#include "src/measure/weights_map.h"

/* One thread's. */
struct overlap_worker {
    struct clipped part;       /* of the clipped tetrahedron, that is in the other one */
    double errors[MAX_CLIP_CORNERS], values[MAX_CLIP_CORNERS]; /* at its corners: bounds, a component's difference */
    double *differences;       /* [4 * components] at the corners of the clipped tetrahedron */
    uint32_t *seen;            /* [tet of the second mesh] the last of the first that it was compared with, and 1 */
    uint32_t *front;           /* those that are to be compared */
    size_t front_count, front_capacity;
    struct body_pairs pairs;
    double lower, place[3];    /* the greatest lower end, and where */
    size_t tet;                /* of the first mesh, that has it */
    uint64_t apart;
    bool no_memory;
};

struct measuring {
    const struct difference_side *sides;
    const struct difference_open *open;
    const double *values[2], *bounds[2];
    uint32_t stride, components;
    uint8_t *usable[2];        /* owned, [tet] */
    uint32_t *bodies[2];       /* owned, [tet]; NULL: each mesh is one body */
    uint64_t *body_volumes[2]; /* owned, [body] */
    double *volumes;           /* owned, [tet of the second mesh] */
    struct weights_map *maps;  /* owned, [tet of the second mesh] */
    struct bvh tree;           /* of it */
    uint32_t *neighbours;      /* owned, of it (adjacency.h) */
    uint8_t *near[2];          /* owned, [tet]: no further from it than it has moved; NULL: it has not */
    enum difference_asked stage; /* what is compared now, where not all is */
    bool same;                 /* the meshes are: only tetrahedra of the same number overlap */
    bool pairing;              /* only which bodies overlap is asked */
    struct body_pairs pairs;   /* judged */
    double unit;               /* of volumes */
    struct overlap_worker *workers;
    struct difference *out;
};

/* Two tetrahedra that may overlap, and what has come together of their cell. */
struct overlap {
    struct measuring *measuring;
    struct overlap_worker *worker;
    uint32_t tets[2];
    int clipped;            /* whose corners the part's weights are of */
    double in[2][4][4];     /* weights of each one's corners in the other */
    double volumes[2], covered, slack, noise; /* covered: of the first's volume, by all of the second mesh */
    double errors[4];       /* bounds at the corners of the clipped one */
    double integral, square, error_square;
    bool near;              /* a boundary that has moved */
    bool ends;              /* the second mesh does, or what is known of it: there may be other tetrahedra */
    double upper, lower;
    double weights[4];      /* where `lower` is */
};

/* Counts for the first one's cell, and for the worker. False: the two touch at most. `map`: the first one's. */
bool overlap_compare(struct overlap *cell, const struct weights_map *map);

/* The same where both meshes are the same. */
void overlap_compare_self(struct overlap *cell);

static inline double overlap_volume(const struct tetmesh *mesh, uint32_t tet)
{
    return fabs(tet_volume6(mesh_corner(mesh, tet, 0), mesh_corner(mesh, tet, 1), mesh_corner(mesh, tet, 2),
                            mesh_corner(mesh, tet, 3))) / 6;
}

#endif
