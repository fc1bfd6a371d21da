/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/mesh/cell_refine.h"

#include <stddef.h>

/* The middle of an edge is the points' entry `middle`. */
struct edge {
    uint8_t a, b, middle;
};

static const struct edge tet_edges[] = {{0, 1, 4}, {1, 2, 5}, {0, 2, 6}, {0, 3, 7}, {1, 3, 8}, {2, 3, 9}};
static const struct edge hexahedron_edges[] = {{0, 1, 8},  {1, 2, 9},  {2, 3, 10}, {3, 0, 11}, {4, 5, 12}, {5, 6, 13},
                                               {6, 7, 14}, {7, 4, 15}, {0, 4, 16}, {1, 5, 17}, {2, 6, 18}, {3, 7, 19}};
static const struct edge wedge_edges[] = {{0, 1, 6},  {1, 2, 7},  {2, 0, 8},  {3, 4, 9}, {4, 5, 10},
                                          {5, 3, 11}, {0, 3, 12}, {1, 4, 13}, {2, 5, 14}};
static const struct edge pyramid_edges[] = {{0, 1, 5}, {1, 2, 6}, {2, 3, 7}, {3, 0, 8}, {0, 4, 9}, {1, 4, 10},
                                            {2, 4, 11}, {3, 4, 12}};

static const struct {
    const struct edge *edges;
    unsigned count;
} edges_of[CELL_SHAPES] = {
    [CELL_TET] = {tet_edges, 6},
    [CELL_HEXAHEDRON] = {hexahedron_edges, 12},
    [CELL_WEDGE] = {wedge_edges, 9},
    [CELL_PYRAMID] = {pyramid_edges, 8},
};

static uint32_t middle_of(enum cell_shape shape, const uint32_t *points, uint8_t a, uint8_t b)
{
    for (unsigned e = 0; e < edges_of[shape].count; e++) {
        struct edge edge = edges_of[shape].edges[e];
        if ((edge.a == a && edge.b == b) || (edge.a == b && edge.b == a))
            return points[edge.middle];
    }
    return points[a]; // not an edge: no table has that
}

/* The triangles of a face: one at each corner, then the polygon of the middles, fanned from its least. */
static unsigned face_triangles(enum cell_shape shape, const uint32_t *points, const uint8_t *face, unsigned sides,
                               uint32_t out[6][3])
{
    uint32_t middles[4];
    unsigned count = 0, least = 0;
    for (unsigned i = 0; i < sides; i++) {
        middles[i] = middle_of(shape, points, face[i], face[(i + 1) % sides]);
        least = middles[i] < middles[least] ? i : least;
    }
    for (unsigned i = 0; i < sides; i++, count++) {
        out[count][0] = points[face[i]];
        out[count][1] = middles[i];
        out[count][2] = middles[(i + sides - 1) % sides];
    }
    for (unsigned i = 1; i + 1 < sides; i++, count++) {
        out[count][0] = middles[least];
        out[count][1] = middles[(least + i) % sides];
        out[count][2] = middles[(least + i + 1) % sides];
    }
    return count;
}

static unsigned refine_tet(const uint32_t *p, uint32_t tets[][4])
{
    /* corners, then the octahedron of the middles about its diagonal from (0, 2) to (1, 3) */
    static const uint8_t eight[8][4] = {{0, 4, 6, 7}, {1, 5, 4, 8}, {2, 6, 5, 9}, {3, 7, 9, 8},
                                        {6, 8, 4, 5}, {6, 8, 5, 9}, {6, 8, 9, 7}, {6, 8, 7, 4}};
    for (unsigned t = 0; t < 8; t++)
        for (unsigned c = 0; c < 4; c++)
            tets[t][c] = p[eight[t][c]];
    return 8;
}

unsigned cell_refine(enum cell_shape shape, const uint32_t *points, uint32_t centre, const double *positions,
                     uint32_t tets[CELL_REFINED_MOST_TETS][4])
{
    unsigned count = 0, sides;
    const uint8_t *face;
    if (shape == CELL_TET)
        count = refine_tet(points, tets);
    for (unsigned f = 0; shape != CELL_TET && (face = cell_face(shape, f, &sides)) != NULL; f++) {
        uint32_t triangles[6][3];
        unsigned n = face_triangles(shape, points, face, sides, triangles);
        for (unsigned t = 0; t < n; t++, count++) {
            tets[count][0] = centre;
            for (unsigned c = 0; c < 3; c++)
                tets[count][c + 1] = triangles[t][c];
        }
    }
    cell_tets_turn(tets, count, positions);
    return count;
}
