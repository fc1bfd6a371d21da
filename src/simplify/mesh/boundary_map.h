/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The map between the boundary that a contraction takes away and the one that it makes in its place: along one
 * direction, the mean normal. Both patches are graphs over a plane and have the same rim. The map is linear on the
 * cells of the overlay of their triangles, so what is to be known of it is known at the overlay's vertices (PROOF.md,
 * 5).
 */
#ifndef TETLOD_BOUNDARY_MAP_H
#define TETLOD_BOUNDARY_MAP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A face of the old patch; and if just one of its corners is contracted, the new face that it becomes. Corner 0 is
 * contracted. */
struct map_face {
    uint32_t corners[3];
    bool inside[3]; /* is the corner contracted? */
    bool vanishes;  /* another one is contracted, too */
    double flat[3][2]; /* in the plane, relative to the result */
};

/* A vertex of the overlay: a point of the old patch, and the one of the new patch that it is mapped to. */
struct map_point {
    uint32_t from[3], to[2];    /* vertices */
    double from_weights[3];     /* they sum to 1 */
    double apex, to_weights[2]; /* of the result and of `to`; they sum to 1, none is negative */
    double distance;            /* widened by its rounding */
};

struct boundary_map {
    const double *positions; /* vertex v's are at stride * v */
    size_t stride;
    uint32_t simplex[4], simplex_count; /* the vertices that are contracted */
    bool moves[4];                      /* is the vertex not at the result? */
    double p[3], direction[3], axes[2][3]; /* the result, and the plane */
    uint32_t face_count, point_count;
    size_t face_room, point_room;
    struct map_face *faces;
    struct map_point *points;
    bool failed; /* out of memory, once */
};

void boundary_map_fini(struct boundary_map *map);

/* Begins a map of contracting a simplex to p. */
void boundary_map_begin(struct boundary_map *map, const double *positions, size_t stride, const uint32_t *simplex,
                        uint32_t count,
                        const double p[3]);

/* Adds the boundary face opposite a corner of a tetrahedron, if the contraction moves one of its corners. Each face is
 * added once. */
void boundary_map_add_face(struct boundary_map *map, const uint32_t corners[4], unsigned opposite);

/* Maps the faces. False: there is no such map, or a face would turn by more than the angle of that cosine, or memory
 * ran out. No points: there are no faces. */
bool boundary_map_find(struct boundary_map *map, double cosine);

/* The least value at the result with which, at every point of the map, the linear interpolant after is at least the one
 * before plus `per_distance` times the distance; -INFINITY: any will do; INFINITY: none does. Vertex v's value is at
 * stride * v. Widened by its rounding. */
double boundary_map_least(const struct boundary_map *map, const double *values, size_t stride, double per_distance);

/* The greatest value at the result with which the interpolant after is nowhere above the one before; INFINITY: any. */
double boundary_map_greatest(const struct boundary_map *map, const double *values, size_t stride);

/* How far the boundary may move at the result at most: the least of what it may at the simplex and at the corners of
 * the faces. */
double boundary_map_most(const struct boundary_map *map, const double *most);

/* How far the boundary will have moved at the result in all, as it has at the vertices (at stride * v); INFINITY: it
 * may not. */
double boundary_map_moved(const struct boundary_map *map, const double *moved, size_t stride, const double *most,
                          double limit);

#endif
