/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The tetrahedra of a mesh in clusters of up to sixteen that lie together, and the vertices that each cluster has:
 * about as many, where the tetrahedra have sixty-four corners. What is asked of all corners is asked of the vertices.
 */
#ifndef TETLOD_CLUSTERS_H
#define TETLOD_CLUSTERS_H

#include "src/mesh/bvh.h"
#include "src/mesh/tetmesh.h"

enum { CLUSTER_TETS = 16, CLUSTER_VERTICES = 4 * CLUSTER_TETS };

struct clusters {
    struct bvh tree;       /* over the tetrahedra: a leaf is a cluster */
    uint32_t *begin;       /* [cluster + 1] into vertices */
    uint32_t *vertices;    /* of the mesh; each cluster's, once each */
    uint8_t (*corners)[4]; /* [place in the tree's order] of the tetrahedron there, among its cluster's vertices */
};

/* Positions are read now only. ERR_NOMEM. O(n log n). */
TETLOD_CHECKED enum tetlod_status clusters_build(struct clusters *clusters, const struct tetmesh *mesh,
                                                 struct tetlod_error *error);
void clusters_fini(struct clusters *clusters);

/* About what they take for so many tetrahedra. */
uint64_t clusters_bytes(uint32_t tets);

/* Memory that building them takes at most. */
uint64_t clusters_building_bytes(uint32_t tets);

#endif
