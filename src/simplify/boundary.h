/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Keeping the boundary (thesis 4.2.2). A boundary vertex is smooth if all its boundary faces have about one normal, on a
 * crease if they have two, in two groups, else a corner. A smooth vertex may move in its plane, one on a crease along it, a
 * corner stays. How far the surface has moved in all is carried along and limited: by an option, and by the distance to other parts
 * of the boundary.
 */
#ifndef TETLOD_BOUNDARY_H
#define TETLOD_BOUNDARY_H

#include "src/simplify/boundary_map.h"
#include "src/simplify/complex.h"

enum boundary_kind { BOUNDARY_CORNER, BOUNDARY_CREASE, BOUNDARY_SMOOTH };

struct boundary {
    double cosine, sine; /* of the angle within which normals count as one */
    double limit;        /* most that the surface may move, in units of length */
    uint8_t *kinds;      /* [slot] enum boundary_kind, of boundary vertices */
    float *directions;   /* [3 * slot] a smooth vertex's normal, a crease's direction */
    double *moved;       /* [slot] how far the surface at the vertex may be from the original one */
    double *most;        /* [slot] how far it may be at most, anywhere on the faces around the vertex */
};

/* What the boundary faces around a vertex say of its kind: their normals, in two groups. */
struct boundary_normals {
    double groups[2][3];
    int count;
    bool corner; /* there are more, or a face without area */
};

void boundary_normals_add(struct boundary_normals *normals, double cosine, const double *p, const double *q, const double *r);
enum boundary_kind boundary_normals_kind(const struct boundary_normals *normals, float direction[3]);

/* May a boundary vertex move by that step? `sine`, `limit`: as in struct boundary. */
bool boundary_step_allowed(enum boundary_kind kind, const float direction[3], double sine, double limit, const double step[3]);

/* Cosine and sine of an angle, 0 .. 180 degrees: from the four operations, so that every machine has the same. */
void boundary_angle(double degrees, double *cosine, double *sine);

/* The boundary may move by `limit`, and by less near other parts of it, but `least` everywhere. ERR_NOMEM, ERR_LIMIT. */
TETLOD_CHECKED enum tetlod_status boundary_init(struct boundary *boundary, const struct complex *complex,
                                                double angle_degrees, double limit, double least,
                                                struct tetlod_error *error);
void boundary_fini(struct boundary *boundary);

/* Takes over new numbers of slots. */
void boundary_renumber(struct boundary *boundary, const struct renumbering *slots);

/* May the gathered simplex be contracted to p = sum of weights times its vertices, as far as each vertex's kind, and
 * the regions, say? */
bool boundary_allows(const struct boundary *boundary, const struct complex *complex, const struct star *star,
                     const double weights[4], const double p[3]);

/* Leaves of a vector what the boundary lets the gathered simplex's result follow, to first order. */
void boundary_follow(const struct boundary *boundary, const struct complex *complex, const struct star *star,
                     double vector[3]);

/* The map of contracting a gathered star to p. False: there is none (boundary_map_find). */
bool boundary_find_map(const struct complex *complex, const struct star *star, const double p[3], double cosine,
                       struct boundary_map *map);

/* How far the boundary would have moved in all at the result of contracting a gathered star to p, and the map; INFINITY: it cannot
 * be mapped, turns by more than the angle or comes too near to another part of it. */
double boundary_moves(const struct boundary *boundary, const struct complex *complex, const struct star *star,
                      const double p[3], struct boundary_map *map);

/* After a contraction: what is known of its result, and the kinds of it and of the boundary vertices around it anew. */
void boundary_update(struct boundary *boundary, const struct complex *complex, uint32_t vertex, double moved, double most);

#endif
