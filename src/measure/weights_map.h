/* SPDX-License-Identifier: BSD-3-Clause */
/* Barycentric weights in a tetrahedron as affine functions of a place, with a bound of their rounding. */
#ifndef TETLOD_WEIGHTS_MAP_H
#define TETLOD_WEIGHTS_MAP_H

#include <float.h>
#include <stdbool.h>
#include <string.h>

#include "src/mesh/bvh.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/tetmesh.h"

/* An intersection goes at least this far inside both tetrahedra, by barycentric weights; less is a contact. */
static const double THIN = 1e-9;

/* lambda_j(p) = rows[j-1] . (p - origin), j = 1..3. */
struct weights_map {
    double origin[3], rows[3][3];
    double noise; /* what rounding makes of a weight of about 1 */
};

static inline const double *mesh_corner(const struct tetmesh *mesh, uint32_t tet, int c)
{
    return mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + (size_t)c];
}

static inline void tet_box(const struct tetmesh *mesh, uint32_t tet, double box[6])
{
    for (int i = 0; i < 3; i++) {
        double x[4];
        for (int c = 0; c < 4; c++)
            x[c] = mesh_corner(mesh, tet, c)[i];
        box[i] = smaller(smaller(x[0], x[1]), smaller(x[2], x[3]));
        box[i + 3] = larger(larger(x[0], x[1]), larger(x[2], x[3]));
    }
}

static inline void make_map(const struct tetmesh *mesh, uint32_t tet, struct weights_map *out)
{
    const double *p[4];
    double edges[3][3];
    for (int c = 0; c < 4; c++)
        p[c] = mesh_corner(mesh, tet, c);
    memcpy(out->origin, p[0], sizeof out->origin);
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++)
            edges[j][i] = p[j + 1][i] - out->origin[i];
    double volume6 = tet_volume6(p[0], p[1], p[2], p[3]), size2 = tet_size_squared(p[0], p[1], p[2], p[3]);
    for (int j = 0; j < 3; j++) {
        const double *u = edges[(j + 1) % 3], *v = edges[(j + 2) % 3];
        for (int i = 0; i < 3; i++)
            out->rows[j][i] = (u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]) / volume6;
    }
    out->noise = 48 * DBL_EPSILON * size2 * sqrt(size2) / fabs(volume6);
}

/* A number at each of the four corners of a tetrahedron. */
typedef double four __attribute__((vector_size(32)));
typedef int64_t four_bits __attribute__((vector_size(32)));

static inline double largest_of(const four *x)
{
    return larger(larger((*x)[0], (*x)[1]), larger((*x)[2], (*x)[3]));
}

static inline double smallest_of(const four *x)
{
    return smaller(smaller((*x)[0], (*x)[1]), smaller((*x)[2], (*x)[3]));
}

/* Offsets of four places from the map's origin. */
static inline void offsets_of(const struct weights_map *map, const double *const p[4], four out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = (four){p[0][i], p[1][i], p[2][i], p[3][i]} - map->origin[i];
}

/* Weight k of four places. Weight 0 comes last: it is what the others leave. */
static inline void weigh_at(const struct weights_map *map, const four r[3], int k, four weights[4])
{
    const double *row = map->rows[(k + 2) % 3];
    weights[k] = k ? row[0] * r[0] + row[1] * r[1] + row[2] * r[2] : 1 - weights[1] - weights[2] - weights[3];
}

/* The weights of one place. */
static inline void weigh_place(const struct weights_map *map, const double p[3], double weights[4])
{
    double r[3] = {p[0] - map->origin[0], p[1] - map->origin[1], p[2] - map->origin[2]};
    for (int k = 0; k < 3; k++)
        weights[k + 1] = map->rows[k][0] * r[0] + map->rows[k][1] * r[1] + map->rows[k][2] * r[2];
    weights[0] = 1 - weights[1] - weights[2] - weights[3];
}

/* Weights in a tetrahedron, whose map is given, of the corners of another one, and what rounding may make of them.
 * False if they all lie on or behind one of its faces: most pairs, so that is asked face by face. */
static inline bool weigh_corners(const struct weights_map *map, const struct tetmesh *mesh, uint32_t tet,
                                 double out[4][4], double *slack)
{
    double largest = 1;
    const double *p[4];
    four r[3], weights[4];
    for (int c = 0; c < 4; c++)
        p[c] = mesh_corner(mesh, tet, c);
    offsets_of(map, p, r);
    for (int k = 1; k < 5; k++) {
        four *w = &weights[k % 4];
        weigh_at(map, r, k % 4, weights);
        double most = largest_of(w);
        largest = larger(largest, larger(most, -smallest_of(w)));
        if (!(most > THIN - map->noise * largest))
            return false;
    }
    for (int c = 0; c < 4; c++)
        for (int k = 0; k < 4; k++)
            out[c][k] = weights[k][c];
    *slack = map->noise * largest;
    return true;
}

/* A tetrahedron: its box, and what its four weights are at a place. */
struct reach {
    double box[6];
    struct weights_map map;
    /* weight k is at_origin[k] + sum over i of rows[i][k] r[i]; their absolute values */
    double at_origin[4], rows[3][4], sizes[3][4];
};

static inline void reach_set(struct reach *reach, const struct tetmesh *mesh, uint32_t tet)
{
    tet_box(mesh, tet, reach->box);
    make_map(mesh, tet, &reach->map);
    for (int i = 0; i < 3; i++) {
        double *row = reach->rows[i];
        for (int k = 0; k < 3; k++)
            row[k] = reach->map.rows[k][i];
        row[3] = -(row[0] + row[1] + row[2]);
        for (int k = 0; k < 4; k++)
            reach->sizes[i][k] = fabs(row[k]);
    }
    for (int k = 0; k < 4; k++)
        reach->at_origin[k] = k == 3;
}

/* What rounding may make of weights in a node's box, and the largest that they are there. */
static inline double weights_in(const struct reach *reach, const float own[6], double most[4])
{
    double size[4] = {1, 1, 1, 1};
    memcpy(most, reach->at_origin, sizeof reach->at_origin);
    for (int i = 0; i < 3; i++) {
        double middle = ((double)own[i] + (double)own[i + 3]) / 2 - reach->map.origin[i];
        double half = ((double)own[i + 3] - (double)own[i]) / 2;
        double farthest = fabs(middle) + half;
        for (int k = 0; k < 4; k++) {
            most[k] += reach->rows[i][k] * middle + reach->sizes[i][k] * half;
            size[k] += reach->sizes[i][k] * farthest;
        }
    }
    return 2 * reach->map.noise * (size[0] + size[1] + size[2]); // no weight in the box is larger than that sum
}

/* Does a node's box reach inside the tetrahedron: into its box, and not as a whole on or behind one of its faces, which
 * all corners in it were then found to be? */
static inline bool reaches(const void *context, const float own[6])
{
    const struct reach *reach = context;
    double most[4];
    if (!bvh_boxes_meet(reach->box, own))
        return false;
    double noise = weights_in(reach, own, most);
    bool behind = false;
    for (int k = 0; k < 4; k++)
        behind |= most[k] <= THIN - noise;
    return !behind;
}

#endif
