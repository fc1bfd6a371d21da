/* SPDX-License-Identifier: BSD-3-Clause */
/* Scalar value assignment, envelope and prediction of one contraction, from their definitions. */
#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/pyramid.h"
#include "tests/test.h"
#include "tests/world.h"

/* A tetrahedron's interpolant of a value per slot, at stride * slot, continued to p. */
static double interpolant(const struct working *working, uint32_t tet, const double *values, size_t stride,
                          const double p[3])
{
    const uint32_t *corners = working->corners[tet];
    const double *q[4];
    double sum = 0, whole;
    for (int c = 0; c < 4; c++)
        q[c] = working_row(working, corners[c]);
    whole = tet_volume6(q[0], q[1], q[2], q[3]);
    for (int c = 0; c < 4; c++) {
        const double *r[4] = {q[0], q[1], q[2], q[3]};
        r[c] = p;
        sum += values[corners[c] * stride] * tet_volume6(r[0], r[1], r[2], r[3]) / whole;
    }
    return sum;
}

/* Least and greatest over the star. */
static void star_bounds(const struct world *world, const double *values, size_t stride, const double p[3],
                        double bounds[2])
{
    bounds[0] = INFINITY;
    bounds[1] = -INFINITY;
    for (uint32_t i = 0; i < world->star.tet_count; i++) {
        double value = interpolant(&world->working, world->star.tets[i], values, stride, p);
        bounds[0] = smaller(bounds[0], value);
        bounds[1] = larger(bounds[1], value);
    }
}

static void check_contraction(struct world *world, struct join *join)
{
    struct run *run = &world->run;
    struct worker *worker = &world->worker;
    const struct working *working = &world->working;
    const struct component *component = &working->components[0];
    double value = NAN, field[2], upper[2], lower[2], scale = 1 / component->scale;
    join->at_one_point = false;
    for (int d = 0; d < 3; d++) {
        join->p[d] = 0;
        for (uint32_t s = 0; s < join->count; s++)
            join->p[d] += working_row(working, join->simplex[s])[d] / join->count;
    }
    REQUIRE(star_gather(&world->star, working, join->simplex, join->count) && outcome_list(run, worker, join));
    if (!star_fits(&world->star, working, join->p))
        return;
    CHECK(outcome_weigh(run, worker, join));
    star_bounds(world, working->values, working->value_count, join->p, field);
    star_bounds(world, working->rows + ROW_FIELDS, working->stride, join->p, upper);
    star_bounds(world, working->rows + ROW_FIELDS + 1, working->stride, join->p, lower);
    outcome_bounds(run, worker, join);
    outcome_say(run, worker, join, true);
    double highest = numbers_of(run, worker, NUMBERS_UPPER)[0], lowest = numbers_of(run, worker, NUMBERS_LOWER)[0];
    CHECK(highest >= upper[1] - 1e-12 * scale && highest <= upper[1] + 1e-9 * scale);
    CHECK(lowest <= lower[0] + 1e-12 * scale && lowest >= lower[0] - 1e-9 * scale);
    double error = outcome_middles(run, worker, &value);
    CHECK(highest >= value && value >= lowest);
    CHECK_NEAR(error, larger(highest - value, value - lowest) * component->factor, 1e-9);
    run->metric = METRIC_SVA; // the middle of what the star's interpolants say, and what they are off by
    error = outcome_values(run, worker, join, &value, NULL);
    run->metric = METRIC_ENVELOPE;
    const double *range = working->fields[0].component_range[0];
    double middle = smaller(larger((field[0] + field[1]) / 2, range[0]), range[1]);
    CHECK_NEAR(value, middle, 1e-6 * scale); // rounded to float32
    CHECK_NEAR(error, larger(field[1] - value, value - field[0]) * component->factor, 1e-9);
    CHECK(value >= range[0] && value <= range[1]);
}

/* Edges, faces and tetrahedra at random; wider: with envelopes of some width at the vertices. */
static void check_contractions(uint32_t size, uint64_t random, bool wider)
{
    struct tetmesh mesh = {0};
    struct world world;
    REQUIRE(sample_find("fin")->make(&mesh, size, NULL) == TETLOD_OK);
    REQUIRE(world_open(&world, &mesh,
                       &(struct world_options){.controlled = (uint32_t[]){0}, .controlled_count = 1, .angle = 30}));
    CHECK_INT(world.working.component_count, 1);
    for (uint32_t v = 0; v < world.working.slot_count; v++) {
        double *bounds = working_row(&world.working, v) + ROW_FIELDS, value = *working_values(&world.working, v, 0);
        CHECK(bounds[0] == value && bounds[1] == value);
        bounds[0] += wider ? (double)(gen_random(&random) % 100) / 1000 : 0;
        bounds[1] -= wider ? (double)(gen_random(&random) % 100) / 1000 : 0;
    }
    for (int i = 0; i < 400; i++) {
        struct join join = {.count = 2 + (uint32_t)(gen_random(&random) % 5) / 2};
        join.count = join.count > 4 ? 4 : join.count;
        if (world_pick(&world, (uint32_t)(gen_random(&random) % mesh.tet_count), (uint32_t)(gen_random(&random) % 4),
                       join.count,
                       join.simplex))
            check_contraction(&world, &join);
    }
    world_close(&world);
    tetmesh_fini(&mesh);
}

static void test_first_contractions(void)
{
    check_contractions(5, 31, false);
}

static void test_later_contractions(void)
{
    check_contractions(4, 32, true);
}

/* Two fields whose limits differ: the error is the one that is further on its way to its own. */
static void test_limits_of_their_own(void)
{
    struct tetmesh mesh = {0};
    struct world world;
    REQUIRE(sample_find("fin")->make(&mesh, 4, NULL) == TETLOD_OK);
    REQUIRE(world_open(&world, &mesh, &(struct world_options){.controlled = (uint32_t[]){0, 1}, .controlled_count = 2,
                                                              .limits = (double[]){1, 0.1}, .angle = 30}));
    CHECK_INT(world.working.component_count, 2);
    double *upper = numbers_of(&world.run, &world.worker, NUMBERS_UPPER),
           *lower = numbers_of(&world.run, &world.worker, NUMBERS_LOWER);
    for (int c = 0; c < 2; c++) {
        double middle = (world.working.fields[c].component_range[0][0] +
                         world.working.fields[c].component_range[0][1]) / 2;
        double half = (c ? 0.05 : 0.1) / world.working.components[c].scale;
        upper[c] = middle + half;
        lower[c] = middle - half;
    }
    CHECK_NEAR(outcome_middles(&world.run, &world.worker, NULL), 0.5, 1e-5); // rounded to float32
    lower[1] += 0.09 / world.working.components[1].scale;
    CHECK_NEAR(outcome_middles(&world.run, &world.worker, NULL), 0.1, 1e-5);
    world_close(&world);
    tetmesh_fini(&mesh);
}

/* What goes with the boundary: a pyramid's top, where a linear field is 1, comes to lie half way to the corner that it
 * is contracted to. The tetrahedra continue the field by 0 there, but the points that were at the top are to keep their
 * values, and those at the bottom. */
static void test_the_map_demands(void)
{
    double values[6];
    for (int sign = -1; sign < 2; sign += 2) {
        struct point_field field = {.name = (char[]){"f"}, .components = 1, .type = TETLOD_FLOAT64, .values = values};
        struct pyramid pyramid;
        pyramid_init(&pyramid);
        struct tetmesh mesh = pyramid.mesh;
        mesh.field_count = 1;
        mesh.fields = &field;
        struct world world;
        for (int v = 0; v < 6; v++)
            values[v] = 4 * sign * mesh.positions[3 * v + 2];
        REQUIRE(world_open(&world, &mesh,
                           &(struct world_options){.controlled = (uint32_t[]){0}, .controlled_count = 1, .angle = 60,
                                                                  .boundary_limit = 0.9}));
        for (uint32_t v = 0; v < 6; v++)
            world.run.border.most[v] = 0.9; // as if there were no other part of the boundary near
        struct join join = {.simplex = {world_slot(&world, 0), world_slot(&world, 1)}, .count = 2, .p = {1, 1, 0}};
        double *upper = numbers_of(&world.run, &world.worker, NUMBERS_UPPER),
               *lower = numbers_of(&world.run, &world.worker, NUMBERS_LOWER);
        REQUIRE(outcome_list(&world.run, &world.worker, &join) && outcome_weigh(&world.run, &world.worker, &join));
        outcome_bounds(&world.run, &world.worker, &join);
        double middle = (upper[0] + lower[0]) / 2;
        CHECK_NEAR(upper[0], middle, 1e-12);
        CHECK_NEAR(lower[0], middle, 1e-12);
        CHECK(!isinf(border_moves(&world.run.border, &world.working, join.simplex, 2, join.p, &world.worker.map)));
        outcome_demands(&world.run, &world.worker);
        CHECK_NEAR(upper[0], sign > 0 ? middle + 2 : middle, 1e-12);
        CHECK_NEAR(lower[0], sign > 0 ? middle : middle - 2, 1e-12);
        world_close(&world);
    }
}

int main(void)
{
    RUN(test_first_contractions);
    RUN(test_later_contractions);
    RUN(test_limits_of_their_own);
    RUN(test_the_map_demands);
    return test_end();
}
