/* SPDX-License-Identifier: BSD-3-Clause */
/* The boundary of a tetrahedral mesh, and its points closest to others. */
#ifndef TETLOD_MESH_SURFACE_H
#define TETLOD_MESH_SURFACE_H

#include "src/mesh/bvh.h"

/* A point as a combination of up to four vertices. */
struct place {
    uint32_t vertices[4];
    double weights[4];
};

struct mesh_surface {
    const double *positions; /* borrowed */
    const uint32_t *bodies;  /* [vertex] borrowed, as sheets_bodies finds them; NULL: all is one */
    uint32_t count;          /* triangles */
    uint32_t *triangles;     /* [3 * triangle] */
    uint32_t *faces;         /* [triangle] 4 * tet + face */
    struct bvh boxes;
};

/* The faces without a neighbour: neighbours[4 * tet + face] as adjacency_build makes them, of the tetrahedra whose
 * state is from `least` to `most` (states NULL: all). Positions are borrowed. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status mesh_surface_init(struct mesh_surface *surface, const double *positions,
                                                    const uint32_t *corners,
                                               const uint32_t *neighbours, uint32_t tet_count, const uint8_t *states,
                                               uint8_t least, uint8_t most, struct tetlod_error *error);
void mesh_surface_fini(struct mesh_surface *surface);

/* The closest point to p of a body's boundary, and its face in *out_face; its distance is returned, INFINITY if there
 * is none. */
double mesh_surface_closest(const struct mesh_surface *surface, uint32_t body, const double p[3], struct place *out,
                            uint32_t *out_face);

/* The distance from p, or, found sooner, that of any point within `enough`. *out_face becomes the face with that
 * point. */
double mesh_surface_distance(const struct mesh_surface *surface, uint32_t body, const double p[3], double enough,
                             uint32_t *out_face);

#endif
