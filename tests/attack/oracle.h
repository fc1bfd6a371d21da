/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What is true of a level, worked out from the meshes alone: nothing of src/ is used. The largest difference of two
 * piecewise linear fields is exact: corners of the overlay in arithmetic of 113 bits.
 *
 * A point of the original is compared with the level's tetrahedra of the same connected part only. Where these cover it
 * more than once, the best value counts. Tetrahedra without an interpolant (flat, inverted) are left out, and those of
 * the original that are folded over a neighbour.
 */
#ifndef TETLOD_ATTACK_ORACLE_H
#define TETLOD_ATTACK_ORACLE_H

#include <float.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if LDBL_MANT_DIG >= 113
typedef long double quad;
#else
typedef __float128 quad;
#endif

enum { ORACLE_MAX_VALUES = 16 }; /* components of all fields together */

/* A mesh as the oracle sees it. The arrays are borrowed. */
struct oracle_mesh {
    uint32_t vertices, tets, value_count;
    const double *positions;
    const uint32_t *corners;
    const double *values[ORACLE_MAX_VALUES]; /* of component i at vertex v: values[i][v * strides[i]] */
    uint32_t strides[ORACLE_MAX_VALUES];
    const uint32_t *part; /* [vertices] connected part */
    const bool *wanted;   /* [tets] of a level: the overlay looks in these only; NULL: in all */
    int turn;             /* the sign of most of the volume: the orientation of the mesh */
    /* worked out by oracle_prepare: */
    struct oracle_tet *details;
};

struct oracle_tet {
    bool usable, solid; /* solid: not flat, so that it has weights */
    double low[3], high[3];
    quad to_weights[9]; /* weights 1..3 of x are this times (x - corner 0) */
    double to_weights_near[9];
};

/* A place where a difference was found. */
struct oracle_place {
    double position[3], value, difference;
    uint32_t tet; /* of the original */
};

int oracle_turn(const double *positions, const uint32_t *corners, uint32_t tets);

/* Signs: +1 as the mesh is oriented, -1 against it, 0 flat (a volume of at most 1e-9 of the cube of the longest
 * edge). */
int oracle_sign(const struct oracle_mesh *mesh, uint32_t tet, double *flatness);

void oracle_prepare(struct oracle_mesh *mesh);
void oracle_leave_out_folds(struct oracle_mesh *mesh); /* of an original: afterwards */
void oracle_finish(struct oracle_mesh *mesh);

/* worst[i]: the largest difference of value i over the common domain, in the field's units, and where it is. Where the
 * original overlaps itself, the level's best value within `radius` counts: the sheet that the value is of may have
 * moved away by as much, and another one be there. */
void oracle_overlay(const struct oracle_mesh *original, const struct oracle_mesh *level, double radius,
                    struct oracle_place worst[ORACLE_MAX_VALUES]);

/* The same of differences above those that `worst` has already: where there are none it stays as it is. */
void oracle_overlay_above(const struct oracle_mesh *original, const struct oracle_mesh *level, double radius,
                          struct oracle_place worst[ORACLE_MAX_VALUES]);

/* Weights of x in a tetrahedron. */
void oracle_weights(const struct oracle_mesh *mesh, uint32_t tet, const quad x[3], quad weights[4]);

/* Does a tetrahedron of the part hold the point, none of whose corners is there? Of a vertex: another sheet touches
 * it. */
bool oracle_touches(const struct oracle_mesh *mesh, uint32_t part, const double point[3]);

/* The smallest difference of value i from `value` at a point, among the level's tetrahedra of a part that hold it:
 * false where none does. */
bool oracle_difference_at(const struct oracle_mesh *level, uint32_t part, const double point[3], uint32_t i,
                          double value, double *out);

/* The least difference of value i from `value` among the points of the level's part within `radius`, or one that is
 * `enough`. */
double oracle_least_near(const struct oracle_mesh *level, uint32_t part, const double point[3], double radius,
                         uint32_t i,
                         quad value, double enough);

/* Is there a point of the level's part within `radius` whose value i is within `within` of `value`? */
bool oracle_partner(const struct oracle_mesh *level, uint32_t part, const double point[3], double radius, uint32_t i,
                    double value, double within);

/* The largest distance of points of a's boundary (vertices, edge middles, and points inside faces) from b's boundary,
 * part by part. */
double oracle_boundary_distance(const struct oracle_mesh *a, const struct oracle_mesh *b);

/* What no level may change, and what none may have more of. */
struct oracle_counts {
    long euler, parts, boundary_parts, overfull_faces, duplicates, inverted, flat;
};

void oracle_count(const struct oracle_mesh *mesh, struct oracle_counts *out);

/* part[v]: the least vertex connected with v by tetrahedra. */
void oracle_parts(uint32_t vertices, const uint32_t *corners, uint32_t tets, uint32_t *part);

/* A tetrahedron's faces in order of their sorted corners: every face appears once for each of its tetrahedra. */
struct oracle_face {
    uint32_t v[3], tet;
};
struct oracle_face *oracle_faces(const struct oracle_mesh *mesh);
bool oracle_same_face(const struct oracle_face *a, const struct oracle_face *b);

void *oracle_memory(size_t count, size_t size); /* zeros; exits where there is none */

#endif
