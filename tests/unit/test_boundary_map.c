/* SPDX-License-Identifier: BSD-3-Clause */
/* The map between a star's old and new boundary, on a pyramid that is flattened and on curved samples. */
#include <math.h>
#include <stdlib.h>

#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/pyramid.h"
#include "tests/test.h"
#include "tests/world.h"

/* A pyramid whose middle may go anywhere. */
static void open_pyramid(struct world *world, struct pyramid *pyramid, double angle)
{
    pyramid_init(pyramid);
    CHECK(world_open(world, &pyramid->mesh, &(struct world_options){.angle = angle, .boundary_limit = 0.9}));
    for (uint32_t v = 0; v < world->working.slot_count; v++)
        world->run.border.most[v] = 0.9;
}

static void test_pyramid(void)
{
    struct pyramid pyramid;
    struct world world;
    struct boundary_map *map = &world.worker.map;
    double by_vertex[6] = {7, 3, 2, 5, 2, 0}, values[6];
    open_pyramid(&world, &pyramid, 60);
    const uint32_t edge[2] = {world_slot(&world, 0), world_slot(&world, 1)};
    for (uint32_t slot = 0; slot < 6; slot++)
        values[slot] = by_vertex[world.working.node[slot]];
    CHECK_NEAR(border_moves(&world.run.border, &world.working, edge, 2, pyramid.positions + 3, map), 0.5, 1e-9);
    CHECK_INT(map->point_count, 1); // the middle, half way along the new edge from corner 1 to corner 3
    REQUIRE(map->point_count == 1);
    CHECK_NEAR(map->points[0].apex, 0.5, 1e-12);
    CHECK_NEAR(map->points[0].distance, 0.25, 1e-12);
    CHECK_NEAR(boundary_map_least(map, values, 1, 0), 9, 1e-12);      // (9 + 5) / 2 is the 7 that was there
    CHECK_NEAR(boundary_map_least(map, values, 1, 4), 11, 1e-12);     // and (11 + 5) / 2 is 1 more
    CHECK_NEAR(boundary_map_greatest(map, values, 1), 9, 1e-12);
    CHECK(boundary_map_least(map, values, 1, 0) >= 9 && boundary_map_greatest(map, values, 1) <= 9);
    world_close(&world);
    open_pyramid(&world, &pyramid, 8); // the faces turn by 14 degrees
    CHECK(border_moves(&world.run.border, &world.working, edge, 2, pyramid.positions + 3, map) == INFINITY);
    world_close(&world);
}

/* How far the boundary has moved at a vertex counts when the vertex moves again: the one that began higher is further
 * in all. */
static void test_moves_add_up(void)
{
    struct pyramid pyramid;
    struct world world;
    open_pyramid(&world, &pyramid, 60);
    const uint32_t edge[2] = {world_slot(&world, 0), world_slot(&world, 1)};
    const struct border *border = &world.run.border;
    double *moved = working_row(&world.working, edge[0]) + row_moved(&world.working);
    // half of it at the middle
    CHECK_NEAR(border_moves(border, &world.working, edge, 2, pyramid.positions + 3, &world.worker.map), 0.5, 1e-9);
    *moved = 0.125;
    CHECK_NEAR(border_moves(border, &world.working, edge, 2, pyramid.positions + 3, &world.worker.map), 0.75, 1e-9);
    *moved = 0.25;
    CHECK(border_moves(border, &world.working, edge, 2, pyramid.positions + 3, &world.worker.map) == INFINITY);
    world_close(&world);
}

/* Of the points of a map of a curved boundary: both ends are convex combinations, the distance is that between them,
 * and the bounds are the least that do. */
static void check_points(const struct boundary_map *map, const struct working *working, const double p[3],
                         uint64_t *random)
{
    double *values = malloc(working->slot_count * sizeof *values);
    REQUIRE(values);
    for (uint32_t v = 0; v < working->slot_count; v++)
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
                sum[d] += weight * working_row(working, v)[d];
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

static void check_curved(const char *name)
{
    struct tetmesh mesh = {0};
    struct world world;
    struct boundary_map *map = &world.worker.map;
    uint64_t random = 3;
    uint32_t mapped = 0, crossed = 0;
    REQUIRE(sample_find(name)->make(&mesh, 4, NULL) == TETLOD_OK);
    REQUIRE(world_open(&world, &mesh, &(struct world_options){.angle = 60, .boundary_limit = 100}));
    for (uint32_t v = 0; v < world.working.slot_count; v++)
        world.run.border.most[v] = 100;
    for (uint32_t t = 0; t < mesh.tet_count; t++)
        for (unsigned f = 0; f < 4; f++) {
            if (!(world.working.boundary_faces[t] >> f & 1))
                continue;
            const uint32_t *corners = world.working.corners[t];
            const uint32_t edge[2] = {corners[tet_faces[f][t % 3]], corners[tet_faces[f][(t + 1) % 3]]};
            const double *a = working_row(&world.working, edge[0]), *b = working_row(&world.working, edge[1]);
            double p[3], half = t % 2 ? 0.5 : 0;
            for (uint32_t d = 0; d < 3; d++)
                p[d] = a[d] + half * (b[d] - a[d]);
            if (isinf(border_moves(&world.run.border, &world.working, edge, 2, p, map)))
                continue;
            bool has_result = half == 0;
            for (uint32_t k = 0; k < map->point_count; k++)
                has_result |= map->points[k].apex == 1;
            CHECK(has_result || !map->point_count);
            mapped++;
            crossed += map->point_count > 3;
            check_points(map, &world.working, p, &random);
        }
    printf("# %s: %u maps, %u of more than three points\n", name, mapped, crossed);
    CHECK(mapped > 100 && crossed > 50);
    world_close(&world);
    tetmesh_fini(&mesh);
}

static void test_curved(void)
{
    check_curved("torus");
    check_curved("shell");
}

int main(void)
{
    RUN(test_pyramid);
    RUN(test_moves_add_up);
    RUN(test_curved);
    return test_end();
}
