/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: the points of a Lagrange cell in VTK's order. They are put into the lattice [k][j][i] first: corners, the points
 * within edges, within faces, within the cell. Then the lattice is cut: a hexahedron into hexahedra, a wedge into
 * wedges, a tetrahedron of order n into n^3 tetrahedra, as regular tetrahedra and octahedra fill one. Triangles and
 * quadrilaterals of a shared face are then the same for both its cells, whichever corner each of them counts from.
 */
#include "src/mesh/cell_lattice.h"

#include <stddef.h>
#include <string.h>

enum { SIDE = CELL_LATTICE_MAX_ORDER + 1, MAX_EDGES = 12, MAX_FACES = 6 };

struct lattice {
    const unsigned *orders;
    const uint32_t *next; /* the next point in VTK's order */
    uint32_t at[SIDE][SIDE][SIDE];
};

/* Corners in units of the orders; edges from one corner to another; faces by a corner and the ends of two of its edges.
 */
struct frame {
    uint8_t corner[8][3], edge[MAX_EDGES][2], face[MAX_FACES][3];
    uint8_t edges, triangles, quadrilaterals; /* the triangles come first */
};

static const struct frame frames[CELL_SHAPES] = {
    [CELL_TET] = {.corner = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                  .edge = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}},
                  .face = {{0, 1, 3}, {2, 3, 1}, {0, 3, 2}, {0, 2, 1}},
                  .edges = 6,
                  .triangles = 4},
    [CELL_WEDGE] = {.corner = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}},
                    .edge = {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}},
                    .face = {{0, 1, 2}, {3, 4, 5}, {0, 1, 3}, {1, 2, 4}, {2, 0, 5}},
                    .edges = 9,
                    .triangles = 2,
                    .quadrilaterals = 3},
    [CELL_HEXAHEDRON] =
        {.corner = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}},
         .edge = {{0, 1}, {1, 2}, {3, 2}, {0, 3}, {4, 5}, {5, 6}, {7, 6}, {4, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}},
         .face = {{0, 3, 4}, {1, 2, 5}, {0, 1, 4}, {3, 2, 7}, {0, 1, 3}, {4, 5, 7}},
         .edges = 12,
         .quadrilaterals = 6},
};

static size_t triangle_points(unsigned order)
{
    return (size_t)(order + 1) * (order + 2) / 2;
}

static size_t count_points(enum cell_shape shape, const unsigned orders[3])
{
    if (shape == CELL_TET)
        return triangle_points(orders[0]) * (orders[0] + 3) / 3;
    if (shape == CELL_WEDGE)
        return triangle_points(orders[0]) * (orders[2] + 1);
    return (size_t)(orders[0] + 1) * (orders[1] + 1) * (orders[2] + 1);
}

bool cell_lattice_fits(enum cell_shape shape, size_t points, const unsigned orders[3])
{
    if (shape != CELL_TET && shape != CELL_WEDGE && shape != CELL_HEXAHEDRON)
        return false;
    for (int d = 0; d < 3; d++)
        if (orders[d] < 1 || orders[d] > CELL_LATTICE_MAX_ORDER)
            return false;
    if ((shape != CELL_HEXAHEDRON && orders[0] != orders[1]) || (shape == CELL_TET && orders[0] != orders[2]))
        return false;
    return count_points(shape, orders) == points;
}

bool cell_lattice_orders(enum cell_shape shape, size_t points, unsigned orders[3])
{
    for (unsigned n = 1; n <= CELL_LATTICE_MAX_ORDER; n++) {
        orders[0] = orders[1] = orders[2] = n;
        if (cell_lattice_fits(shape, points, orders))
            return true;
    }
    return false;
}

unsigned cell_lattice_tets(enum cell_shape shape, const unsigned orders[3])
{
    unsigned cells = orders[0] * orders[1] * orders[2];
    return shape == CELL_TET ? cells : shape == CELL_WEDGE ? 5 * cells : 9 * cells;
}

/* ---- points into the lattice */

/* The next point goes `u` of `order_u` steps from the corner `from` to the corner `to_u`, and as many to `to_v`. */
static void put(struct lattice *l, const struct frame *frame, const uint8_t from_to[3], unsigned u, unsigned v)
{
    const uint8_t *from = frame->corner[from_to[0]], *to_u = frame->corner[from_to[1]],
                  *to_v = frame->corner[from_to[2]];
    unsigned place[3];
    for (int d = 0; d < 3; d++) {
        int steps = (int)(from[d] * l->orders[d]) + (to_u[d] - from[d]) * (int)u + (to_v[d] - from[d]) * (int)v;
        place[d] = (unsigned)steps;
    }
    l->at[place[2]][place[1]][place[0]] = *l->next++;
}

static unsigned order_between(const struct lattice *l, const struct frame *frame, uint8_t a, uint8_t b)
{
    for (int d = 0; d < 3; d++)
        if (frame->corner[a][d] != frame->corner[b][d])
            return l->orders[d];
    return 0;
}

/* Points within a triangle: those at its corners, from order 4 on three of them. */
static void put_triangle(struct lattice *l, const struct frame *frame, const uint8_t face[3], unsigned order)
{
    if (order >= 3)
        put(l, frame, face, 1, 1);
    if (order >= 4) {
        put(l, frame, face, 2, 1);
        put(l, frame, face, 1, 2);
    }
}

/* Points within the cell. Those of a tetrahedron of order 4, and of a wedge's triangles, lie as within a triangle. */
static void put_inside(struct lattice *l, enum cell_shape shape)
{
    const unsigned *n = l->orders;
    if (shape == CELL_TET) {
        if (n[0] == 4)
            l->at[1][1][1] = *l->next++;
        return;
    }
    for (unsigned k = 1; k < n[2]; k++)
        for (unsigned j = 1; j < n[1]; j++)
            for (unsigned i = 1; i < (shape == CELL_WEDGE ? n[0] - j : n[0]); i++)
                l->at[k][j][i] = *l->next++;
}

static void fill(struct lattice *l, enum cell_shape shape)
{
    const struct frame *frame = &frames[shape];
    for (uint8_t c = 0; c < cell_corners(shape); c++)
        put(l, frame, (const uint8_t[3]){c, c, c}, 0, 0);
    for (unsigned e = 0; e < frame->edges; e++) {
        uint8_t a = frame->edge[e][0], b = frame->edge[e][1];
        for (unsigned u = 1; u < order_between(l, frame, a, b); u++)
            put(l, frame, (const uint8_t[3]){a, b, a}, u, 0);
    }
    for (unsigned f = 0; f < frame->triangles + frame->quadrilaterals; f++) {
        const uint8_t *face = frame->face[f];
        unsigned order_u = order_between(l, frame, face[0], face[1]),
                 order_v = order_between(l, frame, face[0], face[2]);
        if (f < frame->triangles)
            put_triangle(l, frame, face, order_u);
        for (unsigned v = 1; f >= frame->triangles && v < order_v; v++)
            for (unsigned u = 1; u < order_u; u++)
                put(l, frame, face, u, v);
    }
    put_inside(l, shape);
}

/* ---- the lattice into tetrahedra */

/* The cell of first order whose corners are so many steps of each axis from the place. */
static unsigned split_small(const struct lattice *l, enum cell_shape shape, const unsigned place[3],
                            const uint8_t (*steps)[3], const double *positions, uint32_t tets[][4])
{
    uint32_t corner[CELL_MAX_CORNERS];
    for (unsigned c = 0; c < cell_corners(shape); c++)
        corner[c] = l->at[place[2] + steps[c][2]][place[1] + steps[c][1]][place[0] + steps[c][0]];
    if (shape != CELL_TET)
        return cell_split(shape, corner, positions, tets);
    memcpy(tets[0], corner, sizeof tets[0]);
    return 1;
}

static unsigned cut_hexahedron(const struct lattice *l, const unsigned place[3], const double *positions,
                               uint32_t tets[][4])
{
    return split_small(l, CELL_HEXAHEDRON, place, frames[CELL_HEXAHEDRON].corner, positions, tets);
}

/* At a place of a triangle's lattice there is a wedge over the triangle that points as the whole does, and one that
 * points the other way where there is room. */
static unsigned cut_wedge(const struct lattice *l, const unsigned place[3], const double *positions, uint32_t tets[][4])
{
    static const uint8_t other[6][3] = {{1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    unsigned sum = place[0] + place[1], count = 0;
    if (sum < l->orders[0])
        count += split_small(l, CELL_WEDGE, place, frames[CELL_WEDGE].corner, positions, tets);
    if (sum + 1 < l->orders[0])
        count += split_small(l, CELL_WEDGE, place, other, positions, tets + count);
    return count;
}

/* At a place: the tetrahedron that points as the whole does, the octahedron beside it about one of its diagonals, and
 * the tetrahedron that points the other way, each where there is room. */
static unsigned cut_tet(const struct lattice *l, const unsigned place[3], const double *positions, uint32_t tets[][4])
{
    static const uint8_t octahedron[4][4][3] = {{{1, 0, 0}, {0, 1, 1}, {1, 1, 0}, {0, 1, 0}},
                                                {{1, 0, 0}, {0, 1, 1}, {1, 0, 1}, {1, 1, 0}},
                                                {{1, 0, 0}, {0, 1, 1}, {0, 0, 1}, {1, 0, 1}},
                                                {{1, 0, 0}, {0, 1, 1}, {0, 1, 0}, {0, 0, 1}}};
    static const uint8_t other[4][3] = {{1, 1, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 0}};
    unsigned sum = place[0] + place[1] + place[2], count = 0;
    if (sum < l->orders[0])
        count += split_small(l, CELL_TET, place, frames[CELL_TET].corner, positions, tets);
    for (unsigned t = 0; sum + 1 < l->orders[0] && t < 4; t++)
        count += split_small(l, CELL_TET, place, octahedron[t], positions, tets + count);
    if (sum + 2 < l->orders[0])
        count += split_small(l, CELL_TET, place, other, positions, tets + count);
    return count;
}

unsigned cell_lattice_split(enum cell_shape shape, const unsigned orders[3], const uint32_t *points,
                            const double *positions, uint32_t tets[CELL_LATTICE_MAX_TETS][4])
{
    struct lattice lattice = {.orders = orders, .next = points};
    unsigned place[3], count = 0;
    fill(&lattice, shape);
    for (place[2] = 0; place[2] < orders[2]; place[2]++)
        for (place[1] = 0; place[1] < orders[1]; place[1]++)
            for (place[0] = 0; place[0] < orders[0]; place[0]++)
                count += shape == CELL_TET     ? cut_tet(&lattice, place, positions, tets + count)
                         : shape == CELL_WEDGE ? cut_wedge(&lattice, place, positions, tets + count)
                                               : cut_hexahedron(&lattice, place, positions, tets + count);
    if (shape == CELL_TET)
        cell_tets_turn(tets, count, positions);
    return count;
}
