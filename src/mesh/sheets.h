/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Which points of a mesh are to be compared with which. Bodies are parts that share no vertex: where two touch or
 * overlap, each is compared with itself. Tetrahedra that are degenerate, inverted, or folded over a neighbour have no
 * promise.
 */
#ifndef TETLOD_SHEETS_H
#define TETLOD_SHEETS_H

#include "src/mesh/orient.h"

/* out[v]: the least vertex of v's body. */
void sheets_bodies(const uint32_t *corners, uint32_t tet_count, uint32_t vertex_count, uint32_t *out);

/* out[t]: 1, or 0 for a tetrahedron without a promise. Returns the mesh's orientation, +1 or -1. `neighbours` as
 * adjacency_build makes them. The orientation of most of the volume is the mesh's; two neighbours that are both
 * oriented so and lie on one side of their common face are folded. */
int sheets_promised(const double *positions, const uint32_t *corners, const uint32_t *neighbours, uint32_t tet_count,
                    uint8_t *out);

/* The same of a mesh whose tetrahedra may be numbered both ways. */
struct sheets {
    uint8_t *promised;        /* owned, [tet] */
    struct oriented oriented; /* the mesh in one turn */
    int orientation;          /* of that */
};

/* `neighbours` as adjacency_build makes them, or NULL. On failure *out is empty. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status sheets_find(struct sheets *out, const struct tetmesh *mesh,
                                              const uint32_t *neighbours, struct tetlod_error *error);
void sheets_fini(struct sheets *sheets);

/* The orientation of tetrahedron t, as it is numbered, where it is not inverted. */
static inline int sheets_orientation(const struct sheets *sheets, size_t t)
{
    return sheets->oriented.turned && sheets->oriented.turned[t] ? -sheets->orientation : sheets->orientation;
}

#endif
