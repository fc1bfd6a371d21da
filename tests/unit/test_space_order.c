/* SPDX-License-Identifier: BSD-3-Clause */
/* Meshes in an order by chance get one of space, the same from any; others are left as they are. */
#include <stdlib.h>

#include "src/mesh/space_order.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "tests/gen.h"
#include "tests/test.h"

enum { CUBES = 38, SIDE = CUBES + 1, POINTS = SIDE * SIDE * SIDE, TETS = 6 * CUBES * CUBES * CUBES };

/* numbers[i]: 0 to count - 1, in an order by chance, or rising. */
static uint32_t *numbers_of(uint32_t count, uint64_t seed)
{
    uint32_t *numbers = array_new(count, sizeof *numbers);
    for (uint32_t i = 0; i < count; i++)
        numbers[i] = i;
    for (uint32_t i = count; seed && i > 1; i--) {
        uint32_t other = (uint32_t)(gen_random(&seed) % i), number = numbers[i - 1];
        numbers[i - 1] = numbers[other];
        numbers[other] = number;
    }
    return numbers;
}

/* Of the points of a lattice: what belongs to a place. */
static double heat_of(const double *place)
{
    return place[0] + 100 * place[1] + 10000 * place[2];
}

/* Of a tetrahedron: what belongs to its corners, in any order. */
static double load_of(const struct tetmesh *mesh, uint32_t tet)
{
    double sum = 0;
    for (int c = 0; c < 4; c++)
        sum += heat_of(mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + c]);
    return sum;
}

static void fill(struct tetmesh *mesh, const uint32_t *point_numbers, const uint32_t *tet_numbers)
{
    static const uint32_t ways[6][2] = {{0, 1}, {1, 2}, {2, 0}, {1, 0}, {2, 1}, {0, 2}};
    static const uint32_t steps[3] = {1, SIDE, SIDE * SIDE};
    for (uint32_t v = 0; v < POINTS; v++) {
        double *place = mesh->positions + 3 * (size_t)point_numbers[v];
        place[0] = v % SIDE;
        place[1] = v / SIDE % SIDE;
        place[2] = v / (SIDE * SIDE);
        mesh->fields[0].values[point_numbers[v]] = heat_of(place);
    }
    for (uint32_t t = 0; t < TETS; t++) {
        uint32_t cube = t / 6, *corners = mesh->corners + 4 * (size_t)tet_numbers[t];
        uint32_t least = cube % CUBES + cube / CUBES % CUBES * SIDE + cube / (CUBES * CUBES) * SIDE * SIDE;
        uint32_t second = least + steps[ways[t % 6][0]], third = second + steps[ways[t % 6][1]];
        const uint32_t points[4] = {least, second, third, least + 1 + SIDE + SIDE * SIDE};
        for (int c = 0; c < 4; c++)
            corners[c] = point_numbers[points[c]];
    }
    for (uint32_t t = 0; t < TETS; t++)
        mesh->cell_fields[0].values[t] = load_of(mesh, t);
}

/* A lattice; seed 0: in its own order. */
static bool make(struct tetmesh *mesh, uint64_t seed)
{
    uint32_t *points = numbers_of(POINTS, seed), *tets = numbers_of(TETS, seed ? seed + 1 : 0);
    *mesh = (struct tetmesh){.vertex_count = POINTS,
                             .tet_count = TETS,
                             .positions = array_new(3 * (size_t)POINTS, sizeof(double)),
                             .corners = array_new(4 * (size_t)TETS, sizeof(uint32_t))};
    bool good = tetmesh_add_field(mesh, "heat", 1, TETLOD_FLOAT64, NULL) == TETLOD_OK &&
                tetmesh_add_cell_field(mesh, "load", 1, TETLOD_FLOAT64, TETS, NULL) == TETLOD_OK;
    if (good)
        fill(mesh, points, tets);
    free(points);
    free(tets);
    return good;
}

static int tets_that_differ(const struct tetmesh *a, const struct tetmesh *b)
{
    int differ = 0;
    for (uint32_t t = 0; t < TETS; t++) {
        uint32_t own[4], other[4];
        sort_corners(a->corners + 4 * (size_t)t, own);
        sort_corners(b->corners + 4 * (size_t)t, other);
        differ += memcmp(own, other, sizeof own) != 0;
    }
    return differ;
}

static void test_any_order_becomes_one(void)
{
    struct tetmesh one, other;
    REQUIRE(make(&one, 5));
    REQUIRE(make(&other, 77));
    CHECK(memcmp(one.positions, other.positions, 3 * (size_t)POINTS * sizeof(double)) != 0);
    CHECK_INT(space_order_settle(&one, NULL), TETLOD_OK);
    CHECK_INT(space_order_settle(&other, NULL), TETLOD_OK);
    CHECK(memcmp(one.positions, other.positions, 3 * (size_t)POINTS * sizeof(double)) == 0);
    CHECK_INT(tets_that_differ(&one, &other), 0);
    uint32_t far = 0;
    double wrong = 0;
    for (uint32_t v = 0; v < POINTS; v++)
        wrong += one.fields[0].values[v] != heat_of(one.positions + 3 * (size_t)v);
    for (uint32_t t = 0; t < TETS; t++) {
        wrong += one.cell_fields[0].values[t] != load_of(&one, t);
        far += abs((int)one.corners[4 * (size_t)t] - (int)one.corners[4 * (size_t)t + 3]) > POINTS / 8;
    }
    CHECK_NEAR(wrong, 0, 0);
    CHECK(far < TETS / 10);
    tetmesh_fini(&one);
    tetmesh_fini(&other);
}

/* An order of the file's own, and tetrahedra that were cells. */
static void test_others_stay(void)
{
    struct tetmesh mesh, same;
    for (int parents = 0; parents < 2; parents++) {
        REQUIRE(make(&mesh, parents ? 9 : 0));
        REQUIRE(make(&same, parents ? 9 : 0));
        mesh.parents = parents ? array_zero(TETS, sizeof *mesh.parents) : NULL;
        CHECK_INT(space_order_settle(&mesh, NULL), TETLOD_OK);
        CHECK(memcmp(mesh.positions, same.positions, 3 * (size_t)POINTS * sizeof(double)) == 0);
        CHECK(memcmp(mesh.corners, same.corners, 4 * (size_t)TETS * sizeof(uint32_t)) == 0);
        tetmesh_fini(&mesh);
        tetmesh_fini(&same);
    }
}

int main(void)
{
    RUN(test_any_order_becomes_one);
    RUN(test_others_stay);
    return test_end();
}
