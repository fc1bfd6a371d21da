/* SPDX-License-Identifier: BSD-3-Clause */
/* The map between a star's old and new boundary, on a pyramid that is flattened and on curved samples. */
#include "src/simplify/boundary.h"

#include <math.h>
#include <stdlib.h>

#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/pyramid.h"
#include "tests/test.h"

static void test_pyramid(void)
{
    struct pyramid pyramid;
    struct complex complex;
    struct star star = {0};
    struct boundary_map map = {0};
    double values[6] = {7, 3, 2, 5, 2, 0};
    pyramid_init(&pyramid);
    REQUIRE(complex_init(&complex, &pyramid.mesh, NULL) == TETLOD_OK);
    REQUIRE(star_gather(&star, &complex, (uint32_t[]){0, 1}, 2, NULL) == TETLOD_OK);
    REQUIRE(boundary_find_map(&complex, &star, pyramid.positions + 3, 0.5, &map));
    CHECK_INT(map.point_count, 1); // the middle, half way along the new edge from corner 1 to corner 3
    CHECK_NEAR(map.points[0].apex, 0.5, 1e-12);
    CHECK_NEAR(map.points[0].distance, 0.25, 1e-12);
    CHECK_NEAR(boundary_map_least(&map, values, 1, 0), 9, 1e-12);      // (9 + 5) / 2 is the 7 that was there
    CHECK_NEAR(boundary_map_least(&map, values, 1, 4), 11, 1e-12);     // and (11 + 5) / 2 is 1 more
    CHECK_NEAR(boundary_map_greatest(&map, values, 1), 9, 1e-12);
    CHECK(boundary_map_least(&map, values, 1, 0) >= 9 && boundary_map_greatest(&map, values, 1) <= 9);
    CHECK(!boundary_find_map(&complex, &star, pyramid.positions + 3, 0.99, &map)); // the faces turn by 14 degrees
    boundary_map_fini(&map);
    star_fini(&star);
    complex_fini(&complex);
}

/* How far the boundary has moved at a vertex counts when the vertex moves again: the one that began higher is further in all. */
static void test_moves_add_up(void)
{
    struct pyramid pyramid;
    struct complex complex;
    struct boundary boundary;
    struct star star = {0};
    struct boundary_map map = {0};
    pyramid_init(&pyramid);
    REQUIRE(complex_init(&complex, &pyramid.mesh, NULL) == TETLOD_OK);
    REQUIRE(boundary_init(&boundary, &complex, 60, 0.9, 0.9, NULL) == TETLOD_OK);
    REQUIRE(star_gather(&star, &complex, (uint32_t[]){0, 1}, 2, NULL) == TETLOD_OK);
    CHECK_NEAR(boundary_moves(&boundary, &complex, &star, pyramid.positions + 3, &map), 0.5, 1e-9); // half of it at the middle
    boundary_update(&boundary, &complex, 0, 0.125, 0.9);
    CHECK_NEAR(boundary_moves(&boundary, &complex, &star, pyramid.positions + 3, &map), 0.75, 1e-9);
    boundary_update(&boundary, &complex, 0, 0.25, 0.9);
    CHECK(boundary_moves(&boundary, &complex, &star, pyramid.positions + 3, &map) == INFINITY);
    boundary_map_fini(&map);
    star_fini(&star);
    boundary_fini(&boundary);
    complex_fini(&complex);
}

/* Of the points of a map of a curved boundary: both ends are convex combinations, the distance is that between them, and the bounds
 * are the least that do. */
static void check_points(const struct boundary_map *map, const struct complex *complex, const double p[3], uint64_t *random)
{
    double *values = malloc(complex->vertex_count * sizeof *values);
    REQUIRE(values);
    for (uint32_t v = 0; v < complex->vertex_count; v++)
        values[v] = gen_unit(random);
    double least = boundary_map_least(map, values, 1, 0.5), tightest = INFINITY;
    for (uint32_t i = 0; i < map->point_count; i++) {
        const struct map_point *at = &map->points[i];
        double from[4] = {0, 0, 0, 0}, to[4] = {p[0] * at->apex, p[1] * at->apex, p[2] * at->apex, least * at->apex};
        double sums[2] = {0, at->apex}, distance2 = 0;
        for (int k = 0; k < 5; k++) {
            uint32_t v = k < 3 ? at->from[k] : at->to[k - 3];
            double weight = k < 3 ? at->from_weights[k] : at->to_weights[k - 3], *sum = k < 3 ? from : to;
            CHECK(weight >= -1e-12);
            sums[k >= 3] += weight;
            for (int d = 0; d < 3; d++)
                sum[d] += weight * complex->positions[3 * v + (uint32_t)d];
            sum[3] += weight * values[v];
        }
        for (int d = 0; d < 3; d++)
            distance2 += (to[d] - from[d]) * (to[d] - from[d]);
        CHECK(at->apex > 0);
        CHECK_NEAR(sums[0], 1, 1e-12);
        CHECK_NEAR(sums[1], 1, 1e-12);
        CHECK_NEAR(at->distance, sqrt(distance2), 1e-9);
        CHECK(to[3] >= from[3] + 0.5 * at->distance - 1e-12);
        tightest = smaller(tightest, to[3] - from[3] - 0.5 * at->distance);
    }
    CHECK(!map->point_count || tightest < 1e-9);
    free(values);
}

static void test_curved(void)
{
    static const char *const names[] = {"torus", "shell"};
    struct boundary_map map = {0};
    for (int i = 0; i < 2; i++) {
        struct tetmesh mesh = {0};
        struct complex complex;
        struct star star = {0};
        uint64_t random = 3;
        uint32_t mapped = 0, crossed = 0;
        REQUIRE(sample_find(names[i])->make(&mesh, 4, NULL) == TETLOD_OK);
        REQUIRE(complex_init(&complex, &mesh, NULL) == TETLOD_OK);
        for (uint32_t t = 0; t < mesh.tet_count; t++)
            for (unsigned f = 0; f < 4; f++) {
                if (!complex_boundary_face(&complex, t, f))
                    continue;
                uint32_t a = mesh.corners[4 * t + tet_faces[f][t % 3]], b = mesh.corners[4 * t + tet_faces[f][(t + 1) % 3]];
                double p[3], half = t % 2 ? 0.5 : 0;
                for (uint32_t d = 0; d < 3; d++)
                    p[d] = mesh.positions[3 * a + d] + half * (mesh.positions[3 * b + d] - mesh.positions[3 * a + d]);
                REQUIRE(star_gather(&star, &complex, (uint32_t[]){a, b}, 2, NULL) == TETLOD_OK);
                if (!boundary_find_map(&complex, &star, p, 0.5, &map))
                    continue;
                bool has_result = half == 0;
                for (uint32_t k = 0; k < map.point_count; k++)
                    has_result |= map.points[k].apex == 1;
                CHECK(has_result || !map.point_count);
                mapped++;
                crossed += map.point_count > 3;
                check_points(&map, &complex, p, &random);
            }
        CHECK(mapped > 100 && crossed > 50);
        star_fini(&star);
        complex_fini(&complex);
        tetmesh_fini(&mesh);
    }
    boundary_map_fini(&map);
}

int main(void)
{
    RUN(test_pyramid);
    RUN(test_moves_add_up);
    RUN(test_curved);
    return test_end();
}
