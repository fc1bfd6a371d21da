/* SPDX-License-Identifier: BSD-3-Clause */
/* Splits keep the volume and agree with the neighbour, however the points are numbered. */
#include "src/mesh/cell_split.h"

#include <stdbool.h>
#include <stdlib.h>

#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "tests/test.h"

static uint32_t next_random(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

static void shuffle(uint32_t *ids, uint32_t count, uint32_t *state)
{
    for (uint32_t i = 0; i < count; i++)
        ids[i] = i;
    for (uint32_t i = count; i > 1; i--) {
        uint32_t j = next_random(state) % i, swap = ids[i - 1];
        ids[i - 1] = ids[j];
        ids[j] = swap;
    }
}

struct solid {
    enum cell_shape shape;
    unsigned tets; /* of its split, whatever the numbering */
    double volume;
    double points[CELL_MAX_CORNERS][3];
};

static const struct solid solids[] = {
    {CELL_PYRAMID, 2, 1.0 / 3, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}}},
    {CELL_WEDGE, 3, 0.5, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}},
    {CELL_HEXAHEDRON, 6, 1, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}},
    {CELL_PENTAGONAL_PRISM, 9, 5,
     {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 3, 0}, {0, 2, 0}, {0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {1, 3, 1}, {0, 2, 1}}},
    {CELL_HEXAGONAL_PRISM, 12, 6,
     {{0, 0, 0}, {1, -1, 0}, {2, 0, 0}, {2, 2, 0}, {1, 3, 0}, {0, 2, 0},
      {0, 0, 1}, {1, -1, 1}, {2, 0, 1}, {2, 2, 1}, {1, 3, 1}, {0, 2, 1}}},
};

static void check_solid(const struct solid *solid, const uint32_t *ids, bool mirrored)
{
    double positions[3 * CELL_MAX_CORNERS], volume = 0;
    uint32_t tets[CELL_MAX_TETS][4], corners = cell_corners(solid->shape);
    for (uint32_t c = 0; c < corners; c++)
        for (int d = 0; d < 3; d++)
            positions[3 * ids[c] + (uint32_t)d] = solid->points[c][d] * (mirrored && d == 0 ? -1 : 1);
    unsigned count = cell_split(solid->shape, ids, positions, tets);
    CHECK_INT(count, solid->tets);
    for (unsigned t = 0; t < count; t++) {
        double part = tet_volume6(positions + 3 * tets[t][0], positions + 3 * tets[t][1], positions + 3 * tets[t][2],
                                  positions + 3 * tets[t][3]) / 6;
        CHECK(part > 0);
        volume += part;
    }
    CHECK_NEAR(volume, solid->volume, 1e-14);
    struct mesh_report report;
    CHECK_INT(mesh_check(positions, tets[0], corners, count, &report, NULL), TETLOD_OK);
    CHECK_INT(report.singular_vertices, 0);
    CHECK_INT(report.euler, 1);
    CHECK_INT(report.boundary_vertices, corners);
}

static void test_every_shape_in_any_numbering(void)
{
    uint32_t ids[CELL_MAX_CORNERS], random = 1;
    for (size_t s = 0; s < sizeof solids / sizeof *solids; s++)
        for (int trial = 0; trial < 200; trial++) {
            shuffle(ids, cell_corners(solids[s].shape), &random);
            check_solid(&solids[s], ids, trial % 2);
        }
}

/* A block of hexahedra and wedges with shuffled ids: all faces must match. */
static void test_neighbours_match(void)
{
    enum { ROW = 4, POINTS = ROW * ROW * ROW, CELLS = (ROW - 1) * (ROW - 1) * (ROW - 1) };
    uint32_t ids[POINTS], random = 2;
    double positions[3 * POINTS];
    uint32_t (*tets)[4] = malloc(CELLS * 2 * CELL_MAX_TETS * sizeof *tets);
    REQUIRE(tets != NULL);
    for (int trial = 0; trial < 50; trial++) {
        uint32_t count = 0;
        shuffle(ids, POINTS, &random);
        for (uint32_t p = 0; p < POINTS; p++) {
            positions[3 * ids[p]] = p % ROW;
            positions[3 * ids[p] + 1] = p / ROW % ROW;
            positions[3 * ids[p] + 2] = p / (ROW * ROW);
        }
        for (uint32_t p = 0; p < POINTS; p++) {
            if (p % ROW == ROW - 1 || p / ROW % ROW == ROW - 1 || p / (ROW * ROW) == ROW - 1)
                continue;
            const uint32_t *a = ids + p, *b = a + ROW * ROW;
            const uint32_t hexahedron[8] = {a[0], a[1], a[ROW + 1], a[ROW], b[0], b[1], b[ROW + 1], b[ROW]};
            const uint32_t wedges[2][6] = {{a[0], a[1], a[ROW + 1], b[0], b[1], b[ROW + 1]},
                                           {a[0], a[ROW + 1], a[ROW], b[0], b[ROW + 1], b[ROW]}};
            if (p % ROW != 1) { // columns of wedges stand in the middle: their triangles face only each other
                count += cell_split(CELL_HEXAHEDRON, hexahedron, positions, tets + count);
                continue;
            }
            for (int w = 0; w < 2; w++)
                count += cell_split(CELL_WEDGE, wedges[w], positions, tets + count);
        }
        struct mesh_report report;
        CHECK_INT(mesh_check(positions, tets[0], POINTS, count, &report, NULL), TETLOD_OK);
        CHECK_INT(report.overfull_faces, 0);
        CHECK_INT(report.same_side_faces, 0);
        CHECK_INT(report.singular_vertices, 0);
        CHECK_INT(report.boundary_faces, 6 * (ROW - 1) * (ROW - 1) * 2);
        CHECK_INT(report.euler, 1);
        CHECK_NEAR(report.volume, CELLS, 1e-12);
    }
    free(tets);
}

static void test_collapsed_cells_lose_their_flat_tetrahedra(void)
{
    const double points[8 * 3] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 0, 0, 0, 0, 0};
    uint32_t tets[CELL_MAX_TETS][4];
    const uint32_t wedge_like[8] = {0, 1, 2, 3, 4, 5, 5, 4}; // the top is an edge
    unsigned count = cell_split(CELL_HEXAHEDRON, wedge_like, points, tets);
    double volume = 0;
    for (unsigned t = 0; t < count; t++)
        volume += tet_volume6(points + 3 * tets[t][0], points + 3 * tets[t][1], points + 3 * tets[t][2],
                              points + 3 * tets[t][3]) / 6;
    CHECK_INT(count, 3);
    CHECK_NEAR(volume, 0.5, 1e-15);
}

/* The triangles that only one of the tetrahedra has, as sorted corners packed in a word; gives their number. */
static unsigned boundary_of(uint32_t (*tets)[4], unsigned count, uint32_t out[4 * CELL_MAX_TETS])
{
    uint32_t all[4 * CELL_MAX_TETS];
    unsigned faces = 0, kept = 0;
    for (unsigned t = 0; t < count; t++)
        for (int skip = 0; skip < 4; skip++) {
            uint32_t set = 0; // a bit for each corner tells the triangle
            for (int c = 0; c < 4; c++)
                set |= c == skip ? 0 : (uint32_t)1 << tets[t][c];
            all[faces++] = set;
        }
    for (unsigned f = 0; f < faces; f++) {
        unsigned uses = 0;
        for (unsigned g = 0; g < faces; g++)
            uses += all[g] == all[f];
        CHECK(uses <= 2);
        if (uses == 1)
            out[kept++] = all[f];
    }
    return kept;
}

static double least_volume(uint32_t (*tets)[4], unsigned count, const double *positions)
{
    double least = 1e300;
    for (unsigned t = 0; t < count; t++) {
        double volume = cell_tet_volume6(tets[t], positions);
        least = volume < least ? volume : least;
    }
    return least;
}

/* Bent cells: the faces are cut as those of one that is not bent, and fewer cells have an inverted tetrahedron than by
 * the cone from the smallest corner alone. */
static void test_bent_cells(void)
{
    enum { TRIALS = 4000 };
    static const uint32_t ids[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    static const double cube[8 * 3] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
    uint32_t straight[CELL_MAX_TETS][4], tets[CELL_MAX_TETS][4], wanted[4 * CELL_MAX_TETS], got[4 * CELL_MAX_TETS];
    unsigned bent = 0, inverted = 0, straight_count = cell_split(CELL_HEXAHEDRON, ids, cube, straight);
    CHECK_INT(straight_count, 6);
    CHECK_INT(boundary_of(straight, straight_count, wanted), 12);
    uint32_t state = 1;
    for (int trial = 0; trial < TRIALS; trial++) {
        double positions[8 * 3];
        for (int i = 0; i < 8 * 3; i++) {
            state = state * 1664525u + 1013904223u;
            positions[i] = cube[i] + 0.7 * (state / 4294967296.0 - 0.5);
        }
        unsigned count = cell_split(CELL_HEXAHEDRON, ids, positions, tets);
        double first = least_volume(straight, 6, positions), chosen = least_volume(tets, count, positions);
        bent += first < 0;
        inverted += chosen < 0;
        CHECK(chosen >= first - 1e-12);
        CHECK_INT(boundary_of(tets, count, got), 12);
        for (int i = 0; i < 12; i++) {
            bool found = false;
            for (int j = 0; j < 12; j++)
                found |= got[i] == wanted[j];
            CHECK(found);
        }
    }
    CHECK(bent > 100);
    CHECK(inverted < bent * 3 / 5);
    printf("# of %u bent cells, %u still have an inverted tetrahedron\n", bent, inverted);
}

/* A grid that is bent so that one way to begin inverts a tetrahedron, and the other does not. */
static void test_bent_grid(void)
{
    const uint32_t dims[3] = {2, 2, 2};
    double positions[8 * 3];
    uint32_t corners[4 * 5];
    for (int corner = 0; corner < 8; corner++) {
        for (uint32_t p = 0; p < 8; p++)
            for (int d = 0; d < 3; d++)
                positions[3 * p + (uint32_t)d] = p >> d & 1;
        for (int d = 0; d < 3; d++) // beyond the plane of its three neighbours
            positions[3 * corner + d] += 0.5 * ((corner >> d & 1) ? -1 : 1);
        grid_split(dims, positions, corners);
        for (int t = 0; t < 5; t++)
            CHECK(cell_tet_volume6(corners + 4 * t, positions) > 0);
    }
}

static void test_grids(void)
{
    const uint32_t flat[3] = {5, 1, 5}, dims[3] = {3, 4, 5};
    double positions[60 * 3];
    uint32_t corners[4 * 120];
    CHECK_INT(grid_tet_count(flat), 0);
    CHECK_INT(grid_tet_count(dims), 120);
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        for (uint32_t p = 0; p < 60; p++) {
            positions[3 * p] = (mirrored ? -1.0 : 1.0) * (p % 3);
            positions[3 * p + 1] = p / 3 % 4;
            positions[3 * p + 2] = p / 12;
        }
        grid_split(dims, positions, corners);
        struct mesh_report report;
        CHECK_INT(mesh_check(positions, corners, 60, 120, &report, NULL), TETLOD_OK);
        CHECK_INT(report.orientation, 1);
        CHECK_INT(report.inverted_tets, 0);
        CHECK_INT(report.overfull_faces + report.same_side_faces + report.singular_vertices, 0);
        CHECK_NEAR(report.volume, 24, 1e-12);
        CHECK_INT(report.euler, 1);
    }
}

int main(void)
{
    RUN(test_every_shape_in_any_numbering);
    RUN(test_neighbours_match);
    RUN(test_collapsed_cells_lose_their_flat_tetrahedra);
    RUN(test_bent_cells);
    RUN(test_bent_grid);
    RUN(test_grids);
    return test_end();
}
