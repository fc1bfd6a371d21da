/* SPDX-License-Identifier: BSD-3-Clause */
/* Where a point lies in a tetrahedral mesh: the tetrahedra that contain it, or the closest point of the boundary. */
#ifndef TETLOD_LOCATE_H
#define TETLOD_LOCATE_H

#include "src/mesh/mesh_surface.h"

struct locator {
    const double *positions; /* borrowed */
    const uint32_t *corners; /* borrowed */
    uint32_t tet_count;
    uint32_t *neighbours; /* [4 * tet] as adjacency_build makes them */
    struct bvh tets;
    struct mesh_surface surface;
};

/* ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status locator_init(struct locator *locator, const double *positions, uint32_t vertex_count,
                                               const uint32_t *corners, uint32_t tet_count, struct tetlod_error *error);

void locator_fini(struct locator *locator);

/* Barycentric weights of p in a tetrahedron; their least is returned (>= 0: inside), -INFINITY if it has no volume. */
double locator_weights(const struct locator *locator, uint32_t tet, const double p[3], double weights[4]);

/* Does a tetrahedron contain p: are all weights at least -1e-9? */
bool locator_contains(const struct locator *locator, uint32_t tet, const double p[3], double weights[4]);

/* Up to `most` tetrahedra that contain p. Returns their number. O(log n) for meshes without overlap. */
uint32_t locator_find(const struct locator *locator, const double p[3], uint32_t *out_tets, uint32_t most);

/* Walks from a tetrahedron towards p, across the face that p is furthest behind. The tetrahedron that contains p, or
 * TETLOD_NONE if the walk leaves the mesh or does not end soon: then locator_find decides. */
uint32_t locator_walk(const struct locator *locator, uint32_t from, const double p[3], double weights[4]);

/* The boundary's closest point to p; its distance is returned, INFINITY if there is no boundary. */
double locator_closest(const struct locator *locator, const double p[3], struct place *out);

#endif
