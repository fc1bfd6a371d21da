/* SPDX-License-Identifier: BSD-3-Clause */
/* Splitting by smallest id: Dompierre, Labbé, Vallet, Camarero, "How to subdivide pyramids, prisms and hexahedra into
 * tetrahedra" (1999); here as one cone for every shape, which a table of faces describes. */
#include "src/mesh/cell_split.h"

#include <stddef.h>
#include <string.h>

#include "src/mesh/tet_geom.h"

enum { MAX_FACES = 8, MAX_SIDES = 6 };

struct shape {
    uint8_t corners, faces;
    uint8_t sides[MAX_FACES];
    uint8_t face[MAX_FACES][MAX_SIDES]; /* counter-clockwise seen from outside */
};

static const struct shape shapes[CELL_SHAPES] = {
    [CELL_TET] = {4, 4, {3, 3, 3, 3}, {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}},
    [CELL_PYRAMID] = {5, 5, {4, 3, 3, 3, 3}, {{0, 3, 2, 1}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}}},
    [CELL_WEDGE] = {6, 5, {3, 3, 4, 4, 4}, {{0, 2, 1}, {3, 4, 5}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}},
    [CELL_HEXAHEDRON] = {8,
                         6,
                         {4, 4, 4, 4, 4, 4},
                         {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}},
    [CELL_PENTAGONAL_PRISM] = {10,
                               7,
                               {5, 5, 4, 4, 4, 4, 4},
                               {{0, 4, 3, 2, 1},
                                {5, 6, 7, 8, 9},
                                {0, 1, 6, 5},
                                {1, 2, 7, 6},
                                {2, 3, 8, 7},
                                {3, 4, 9, 8},
                                {4, 0, 5, 9}}},
    [CELL_HEXAGONAL_PRISM] = {12,
                              8,
                              {6, 6, 4, 4, 4, 4, 4, 4},
                              {{0, 5, 4, 3, 2, 1},
                               {6, 7, 8, 9, 10, 11},
                               {0, 1, 7, 6},
                               {1, 2, 8, 7},
                               {2, 3, 9, 8},
                               {3, 4, 10, 9},
                               {4, 5, 11, 10},
                               {5, 0, 6, 11}}},
};

unsigned cell_corners(enum cell_shape shape)
{
    return shapes[shape].corners;
}

const uint8_t *cell_face(enum cell_shape shape, unsigned face, unsigned *out_sides)
{
    const struct shape *s = &shapes[shape];
    if (face >= s->faces)
        return NULL;
    *out_sides = s->sides[face];
    return s->face[face];
}

double cell_tet_volume6(const uint32_t tet[4], const double *positions)
{
    return tet_volume6(positions + 3 * (size_t)tet[0], positions + 3 * (size_t)tet[1], positions + 3 * (size_t)tet[2],
                       positions + 3 * (size_t)tet[3]);
}

void cell_tet_turn(uint32_t tet[4])
{
    uint32_t swap = tet[2];
    tet[2] = tet[3];
    tet[3] = swap;
}

void cell_tets_turn(uint32_t (*tets)[4], size_t count, const double *positions)
{
    double volume = 0;
    for (size_t t = 0; t < count; t++)
        volume += cell_tet_volume6(tets[t], positions);
    for (size_t t = 0; volume < 0 && t < count; t++)
        cell_tet_turn(tets[t]);
}

/* The cone from `apex` over the triangles of a face that it is not a corner of; the face is fanned from its smallest
 * vertex. */
static unsigned cone(uint32_t apex, const uint32_t *face, unsigned sides, uint32_t tets[][4])
{
    unsigned least = 0, count = 0;
    for (unsigned s = 1; s < sides; s++)
        if (face[s] < face[least])
            least = s;
    for (unsigned s = 1; s + 1 < sides; s++) {
        uint32_t a = face[least], b = face[(least + s) % sides], c = face[(least + s + 1) % sides];
        if (a == b || b == c || c == a || a == apex || b == apex || c == apex)
            continue;
        tets[count][0] = apex;
        tets[count][1] = a;
        tets[count][2] = b;
        tets[count++][3] = c;
    }
    return count;
}

/* The cell as a cone from one of its corners; *least is the least volume of a tetrahedron as a fraction of the cell's:
 * negative if one is inverted. */
static unsigned cone_from(const struct shape *s, const uint32_t *corners, uint32_t apex, const double *positions,
                          uint32_t tets[CELL_MAX_TETS][4], double *least)
{
    uint32_t face[MAX_SIDES];
    unsigned count = 0;
    for (unsigned f = 0; f < s->faces; f++) {
        for (unsigned i = 0; i < s->sides[f]; i++)
            face[i] = corners[s->face[f][i]];
        count += cone(apex, face, s->sides[f], tets + count);
    }
    cell_tets_turn(tets, count, positions);
    double all = 0;
    *least = 0;
    for (unsigned t = 0; t < count; t++) {
        double volume = cell_tet_volume6(tets[t], positions);
        *least = t == 0 || volume < *least ? volume : *least;
        all += volume;
    }
    *least = all > 0 ? *least / all : 0; // a cell without volume is as good as it gets
    return count;
}

unsigned cell_split(enum cell_shape shape, const uint32_t *corners, const double *positions,
                    uint32_t tets[CELL_MAX_TETS][4])
{
    static const double NOISE = 1e-9; // of volumes that should be 0
    const struct shape *s = &shapes[shape];
    uint32_t apex = corners[0], trial[CELL_MAX_TETS][4];
    double least = 0, best;
    for (unsigned c = 1; c < s->corners; c++)
        apex = corners[c] < apex ? corners[c] : apex;
    unsigned count = cone_from(s, corners, apex, positions, tets, &least);
    best = least;
    // from another corner: other diagonals inside, the same on the faces
    for (unsigned c = 0; c < s->corners && best < -NOISE; c++) {
        unsigned other = cone_from(s, corners, corners[c], positions, trial, &least);
        if (least <= best)
            continue;
        best = least;
        count = other;
        memcpy(tets, trial, other * sizeof *tets);
    }
    return count;
}

uint64_t grid_tet_count(const uint32_t dims[3])
{
    for (int d = 0; d < 3; d++)
        if (dims[d] < 2)
            return 0;
    return 5 * (uint64_t)(dims[0] - 1) * (dims[1] - 1) * (dims[2] - 1);
}

/* Of a hexahedron's corners, for cells with i + j + k even and odd; the first is the one in the centre. */
static const uint8_t five_tets[2][5][4] = {
    {{1, 3, 4, 6}, {0, 1, 3, 4}, {2, 3, 1, 6}, {5, 4, 6, 1}, {7, 6, 4, 3}},
    {{0, 5, 2, 7}, {1, 2, 0, 5}, {3, 0, 2, 7}, {4, 7, 5, 0}, {6, 5, 7, 2}},
};

/* With the cells that have i + j + k even split in the first way or in the second. Gives how many tetrahedra are
 * inverted. */
static size_t split_by_parity(const uint32_t dims[3], const double *positions, unsigned parity, uint32_t *corners)
{
    uint32_t row = dims[0], slab = dims[0] * dims[1];
    size_t count = 0, inverted = 0;
    for (uint32_t k = 0; k + 1 < dims[2]; k++)
        for (uint32_t j = 0; j + 1 < dims[1]; j++)
            for (uint32_t i = 0; i + 1 < dims[0]; i++) {
                uint32_t o = i + row * j + slab * k;
                const uint32_t cell[8] = {o,        o + 1,        o + row + 1,        o + row,
                                          o + slab, o + slab + 1, o + slab + row + 1, o + slab + row};
                for (int t = 0; t < 5; t++, count++) {
                    uint32_t *tet = corners + 4 * count;
                    for (int c = 0; c < 4; c++)
                        tet[c] = cell[five_tets[(i + j + k + parity) & 1][t][c]];
                }
            }
    cell_tets_turn((uint32_t (*)[4])corners, count, positions);
    for (size_t t = 0; t < count; t++)
        inverted += cell_tet_volume6(corners + 4 * t, positions) < 0;
    return inverted;
}

void grid_split(const uint32_t dims[3], const double *positions, uint32_t *corners)
{
    size_t inverted = split_by_parity(dims, positions, 0, corners);
    if (inverted && split_by_parity(dims, positions, 1, corners) >= inverted)
        split_by_parity(dims, positions, 0, corners);
}
