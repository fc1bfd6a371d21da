/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The map between the boundary that contracting an edge takes away and the one that it makes in its place: along one direction,
 * the mean normal. Both patches are graphs over a plane and have the same rim. The map is linear on the cells of the overlay
 * of their triangles, so what is to be known of it is known at the overlay's vertices (PROOF.md, 5).
 */
#ifndef TETLOD_BOUNDARY_MAP_H
#define TETLOD_BOUNDARY_MAP_H

#include "src/simplify/working.h"

/* A face of the old patch; and if just one of its corners is contracted, the new face that it becomes. Corner 0 is contracted. */
struct map_face {
    uint32_t corners[3];
    bool inside[3]; /* is the corner contracted? */
    bool vanishes;  /* another one is contracted, too */
    double flat[3][2]; /* in the plane, relative to the result */
};

/* A vertex of the overlay: a point of the old patch, and the one of the new patch that it is mapped to. */
struct map_point {
    uint32_t from[3], to[2];    /* slots */
    double from_weights[3];     /* they sum to 1 */
    double apex, to_weights[2]; /* of the result and of `to`; they sum to 1 */
    double distance;
};

struct boundary_map {
    const struct working *working;
    uint32_t ends[2];
    bool moves[2];
    double p[3], direction[3], axes[2][3];
    uint32_t face_count, point_count;
    size_t face_room, point_room;
    struct map_face *faces;
    struct map_point *points;
};

enum map_status { MAP_NONE, MAP_FOUND, MAP_NO_MEMORY };

void boundary_map_fini(struct boundary_map *map);

/* Maps the boundary around an edge to what contracting it to p makes of it. MAP_NONE: there is no such map, or a face would turn by
 * more than the angle of that cosine. No points: the boundary stays as it is. */
enum map_status boundary_map_find(struct boundary_map *map, const struct working *working, const uint32_t ends[2],
                                  const double p[3], double cosine);

/* The least value at the result with which, at every point of the map, the linear interpolant after is at least the one before
 * plus `per_distance` times the distance; -INFINITY: any will do. Values are the rows' in that column. Widened by its rounding. */
double boundary_map_least(const struct boundary_map *map, uint32_t column, double per_distance);

/* The greatest value at the result with which the interpolant after is nowhere above the one before; INFINITY: any. */
double boundary_map_greatest(const struct boundary_map *map, uint32_t column);

#endif
