/* SPDX-License-Identifier: BSD-3-Clause */
/* Where a point lies in a tetrahedral mesh: the tetrahedra that contain it, or the closest point of the boundary. */
#ifndef TETLOD_LOCATE_H
#define TETLOD_LOCATE_H

#include "src/mesh/bvh.h"

struct locator {
    const double *positions; /* borrowed */
    const uint32_t *corners; /* borrowed */
    uint32_t tet_count, triangle_count;
    uint32_t *triangles;  /* [3 * triangle] the boundary */
    uint32_t *faces;      /* [triangle] 4 * tet + face */
    const uint32_t *neighbours; /* [4 * tet] as adjacency_build makes them */
    uint32_t *own_neighbours;   /* they, or NULL: borrowed */
    uint32_t *tet_of;     /* [vertex] one of its tetrahedra */
    struct bvh tets, surface;
};

/* ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status locator_init(struct locator *locator, const double *positions, uint32_t vertex_count,
                                               const uint32_t *corners, uint32_t tet_count, struct tetlod_error *error);

/* The same for who knows the neighbours (borrowed) and an order of the tetrahedra that keeps those close to each other together
 * (taken over, also when it fails). O(n). */
TETLOD_CHECKED enum tetlod_status locator_init_known(struct locator *locator, const double *positions,
                                                     uint32_t vertex_count, const uint32_t *corners, uint32_t tet_count,
                                                     const uint32_t *neighbours, uint32_t *order, unsigned threads,
                                                     struct tetlod_error *error);
void locator_fini(struct locator *locator);

/* The point as a combination of up to four vertices. */
struct place {
    uint32_t vertices[4];
    double weights[4];
};

/* Barycentric weights of p in a tetrahedron; their least is returned (>= 0: inside), -INFINITY if it has no volume. */
double locator_weights(const struct locator *locator, uint32_t tet, const double p[3], double weights[4]);

/* Up to `most` tetrahedra that contain p (weights >= -1e-9). Returns their number. O(log n) for meshes without overlap. */
uint32_t locator_find(const struct locator *locator, const double p[3], uint32_t *out_tets, uint32_t most);

/* Walks from a tetrahedron towards p, across the face that p is furthest behind. The tetrahedron that contains p, or
 * TETLOD_NONE if the walk leaves the mesh or does not end soon: then locator_find decides. */
uint32_t locator_walk(const struct locator *locator, uint32_t from, const double p[3], double weights[4]);

/* The boundary's closest point to p; its distance is returned, INFINITY if there is no boundary. */
double locator_closest(const struct locator *locator, const double p[3], struct place *out);

/* The boundary's distance from p, or, found sooner, that of any point of it within `enough`. *io_face, 4 * tet + face, is a guess
 * (TETLOD_NONE: none) and becomes the face with that point. */
double locator_distance(const struct locator *locator, const double p[3], double enough, uint32_t *io_face);

#endif
