/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The boundary of the working mesh: which faces and vertices it has, and where they may move (thesis 4.2.2). A boundary
 * vertex is smooth if all its boundary faces have about one normal, on a crease if they have two, in two groups, else a
 * corner. A smooth vertex may move in its plane, one on a crease along it, a corner stays.
 */
#ifndef TETLOD_BORDER_H
#define TETLOD_BORDER_H

#include "src/simplify/mesh/boundary_map.h"
#include "src/simplify/mesh/star_data.h"
#include "src/util/parallel.h"

enum boundary_kind { BOUNDARY_CORNER, BOUNDARY_CREASE, BOUNDARY_SMOOTH };

struct border {
    double cosine, sine; /* of the angle within which normals count as one */
    double limit;        /* most that the surface may move, in units of length */
    double *most;        /* [slot] how far it may move, anywhere on the faces around the vertex (clearance.h) */
    uint8_t *kinds;      /* [slot] enum boundary_kind, of boundary vertices */
    float *directions;   /* [3 * slot] a smooth vertex's normal, a crease's direction */
};

/* Finds the working mesh's boundary faces and vertices, those that are no manifold points, and freezes those of folded
 * tetrahedra. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status border_find(struct working *working, struct pool *pool, struct tetlod_error *error);

/* Do the tetrahedron and one that shares a face with it lie on the same side of that, both well oriented? Then they
 * overlap. */
bool border_folded(const struct working *working, uint32_t tet);

/* Of the mesh's working mesh. The boundary may move by `limit`, and by less near other parts of it, but by `least`
 * everywhere. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status border_init(struct border *border, const struct working *working,
                                              const struct tetmesh *mesh,
                                               double angle_degrees, double limit, double least, unsigned threads,
                                             struct tetlod_error *error);
/* How far each vertex of the mesh may move, for border->most: out [vertex of the mesh]. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status border_find_most(double *out, const struct working *working,
                                                   const struct tetmesh *mesh, double limit, double least,
                                                   unsigned threads, struct tetlod_error *error);

/* Of a part of a mesh before its first contraction here: `most` [vertex] is what border_init has found for the whole,
 * or contractions have left of it. ERR_NOMEM. */
TETLOD_CHECKED enum tetlod_status border_resume(struct border *border, const struct working *working,
                                                const double *most,
                                                double angle_degrees, double limit, struct tetlod_error *error);
void border_renumber(struct border *border, const struct renumbering *numbers);
void border_fini(struct border *border);

/* A boundary vertex's kind anew. */
void border_classify(struct border *border, const struct working *working, uint32_t slot);

/* May a boundary vertex move by that step? */
bool border_may_move(const struct border *border, uint32_t slot, const double step[3]);

/* May a simplex be contracted to p = sum of weights times its vertices, as far as each vertex's kind, and the regions,
 * say? */
bool border_allows(const struct border *border, const struct working *working, const uint32_t *simplex, uint32_t count,
                   const double weights[4], const double p[3]);

/* Leaves of a vector what the boundary lets the result of contracting the simplex follow, to first order. */
void border_follow(const struct border *border, const struct working *working, const uint32_t *simplex, uint32_t count,
                   double vector[3]);

/* How far the boundary would have moved in all at the result of contracting a simplex to p, and the map; INFINITY: it
 * cannot be mapped, turns by more than the angle or comes too near to another part of it. */
double border_moves(const struct border *border, const struct working *working, const uint32_t *simplex, uint32_t count,
                    const double p[3], struct boundary_map *map);

#endif
