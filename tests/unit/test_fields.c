/* SPDX-License-Identifier: BSD-3-Clause */
/* Scalar value assignment, envelope and prediction of one contraction, from their definitions. */
#include "src/simplify/boundary.h"
#include "src/simplify/fields.h"

#include <stdlib.h>

#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/pyramid.h"
#include "tests/test.h"

/* A tetrahedron's interpolant of a value per slot, continued to p. */
static double interpolant(const struct complex *complex, uint32_t tet, const double *values, const double p[3])
{
    const uint32_t *corners = complex->corners + 4 * tet;
    const double *q[4];
    double sum = 0, whole;
    for (int c = 0; c < 4; c++)
        q[c] = complex->positions + 3 * corners[c];
    whole = tet_volume6(q[0], q[1], q[2], q[3]);
    for (int c = 0; c < 4; c++) {
        const double *r[4] = {q[0], q[1], q[2], q[3]};
        r[c] = p;
        sum += values[corners[c]] * tet_volume6(r[0], r[1], r[2], r[3]) / whole;
    }
    return sum;
}

/* Least and greatest over the star. */
static void star_bounds(const struct complex *complex, const struct star *star, const double *values, const double p[3],
                        double bounds[2])
{
    bounds[0] = INFINITY;
    bounds[1] = -INFINITY;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        double value = interpolant(complex, star->tets[i], values, p);
        bounds[0] = smaller(bounds[0], value);
        bounds[1] = larger(bounds[1], value);
    }
}

static const struct boundary_map no_map; /* the edge is inside, or the boundary does not matter */

static void check_contraction(struct complex *complex, struct fields *fields, const uint32_t edge[2])
{
    struct star star = {0};
    struct outcome outcome;
    struct driver *driver = &fields->drivers[0];
    double p[3], assigned = NAN, field[2], upper[2], lower[2], scale = 1 / driver->scale;
    REQUIRE(star_gather(&star, complex, edge, 2, NULL) == TETLOD_OK);
    for (int d = 0; d < 3; d++)
        p[d] = (complex->positions[3 * edge[0] + d] + complex->positions[3 * edge[1] + d]) / 2;
    if (!star_fits(&star, complex, p)) {
        star_fini(&star);
        return;
    }
    star_bounds(complex, &star, fields->fields[0].values, p, field);
    star_bounds(complex, &star, driver->upper, p, upper);
    star_bounds(complex, &star, driver->lower, p, lower);
    fields_outcome(fields, complex, &star, &no_map, p, &assigned, &outcome);
    const double *range = fields->fields[0].component_range[0];
    double middle = smaller(larger((field[0] + field[1]) / 2, range[0]), range[1]);
    CHECK_NEAR(outcome.value, middle, 1e-6 * scale); // rounded to float32
    CHECK(outcome.upper >= outcome.value && outcome.value >= outcome.lower);
    CHECK(outcome.upper >= upper[1] - 1e-12 * scale && outcome.upper <= upper[1] + 1e-9 * scale);
    CHECK(outcome.lower <= lower[0] + 1e-12 * scale && outcome.lower >= lower[0] - 1e-9 * scale);
    CHECK(outcome.value >= range[0] && outcome.value <= range[1]);
    double most = larger(outcome.upper - outcome.value, outcome.value - outcome.lower);
    CHECK_NEAR(outcome_error(fields, &outcome), most * driver->scale, 1e-9);
    CHECK(outcome.predicted >= (field[1] - field[0]) / 2 - 1e-9 * scale); // what this contraction adds, at least
    star_fini(&star);
}

static void test_first_contractions(void)
{
    struct tetmesh mesh = {0};
    struct complex complex;
    struct fields fields;
    uint64_t random = 31;
    REQUIRE(sample_find("fin")->make(&mesh, 5, NULL) == TETLOD_OK);
    REQUIRE(complex_init(&complex, &mesh, NULL) == TETLOD_OK);
    REQUIRE(fields_init(&fields, &mesh, (uint32_t[]){0}, 1, NULL, NULL) == TETLOD_OK);
    CHECK_INT(fields.driver_count, 1);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        CHECK(fields.drivers[0].upper[v] == mesh.fields[0].values[v] && fields.drivers[0].lower[v] == mesh.fields[0].values[v]);
    for (int i = 0; i < 400; i++) {
        const uint32_t *corners = complex.corners + 4 * (gen_random(&random) % mesh.tet_count);
        check_contraction(&complex, &fields, corners + gen_random(&random) % 3);
    }
    fields_fini(&fields);
    complex_fini(&complex);
    tetmesh_fini(&mesh);
}

/* With wider envelopes at the vertices the outcome encloses all of them. */
static void test_later_contractions(void)
{
    struct tetmesh mesh = {0};
    struct complex complex;
    struct fields fields;
    uint64_t random = 32;
    REQUIRE(sample_find("fin")->make(&mesh, 4, NULL) == TETLOD_OK);
    REQUIRE(complex_init(&complex, &mesh, NULL) == TETLOD_OK);
    REQUIRE(fields_init(&fields, &mesh, (uint32_t[]){0}, 1, NULL, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        fields.drivers[0].upper[v] += (double)(gen_random(&random) % 100) / 1000;
        fields.drivers[0].lower[v] -= (double)(gen_random(&random) % 100) / 1000;
    }
    for (int i = 0; i < 300; i++) {
        const uint32_t *corners = complex.corners + 4 * (gen_random(&random) % mesh.tet_count);
        check_contraction(&complex, &fields, corners + gen_random(&random) % 3);
    }
    fields_fini(&fields);
    complex_fini(&complex);
    tetmesh_fini(&mesh);
}

/* Two fields whose limits differ: the error is the one that is further on its way to its own. */
static void test_limits_of_their_own(void)
{
    struct tetmesh mesh = {0};
    struct fields fields;
    REQUIRE(sample_find("fin")->make(&mesh, 4, NULL) == TETLOD_OK);
    REQUIRE(fields_init(&fields, &mesh, (uint32_t[]){0, 1}, 2, (double[]){1, 0.1}, NULL) == TETLOD_OK);
    CHECK_INT(fields.driver_count, 2);
    struct outcome outcomes[2] = {{.value = 0, .upper = 0.2 / fields.drivers[0].scale, .lower = 0},
                                  {.value = 0, .upper = 0, .lower = -0.1 / fields.drivers[1].scale}};
    CHECK_NEAR(outcome_error(&fields, outcomes), 1, 1e-12);
    outcomes[1].lower /= 10;
    CHECK_NEAR(outcome_error(&fields, outcomes), 0.2, 1e-12);
    fields_fini(&fields);
    tetmesh_fini(&mesh);
}

/* What goes with the boundary: a pyramid's top, where a linear field is 1, comes to lie half way to the corner that it is contracted to. The
 * tetrahedra continue the field by 0 there, but the points that were at the top are to keep their values, and those at the bottom. */
static void test_the_map_demands(void)
{
    double values[6], p[3] = {1, 1, 0};
    for (int sign = -1; sign < 2; sign += 2) {
        struct point_field field = {.name = (char[]){"f"}, .components = 1, .type = TETLOD_FLOAT64, .values = values};
        struct pyramid pyramid;
        pyramid_init(&pyramid);
        struct tetmesh mesh = pyramid.mesh;
        mesh.field_count = 1;
        mesh.fields = &field;
        struct complex complex;
        struct fields fields;
        struct star star = {0};
        struct boundary_map map = {0};
        struct outcome outcome;
        double assigned = NAN;
        for (int v = 0; v < 6; v++)
            values[v] = 4 * sign * mesh.positions[3 * v + 2];
        REQUIRE(complex_init(&complex, &mesh, NULL) == TETLOD_OK);
        REQUIRE(fields_init(&fields, &mesh, (uint32_t[]){0}, 1, NULL, NULL) == TETLOD_OK);
        REQUIRE(star_gather(&star, &complex, (uint32_t[]){0, 1}, 2, NULL) == TETLOD_OK);
        REQUIRE(boundary_find_map(&complex, &star, p, 0.5, &map));
        fields_outcome(&fields, &complex, &star, &no_map, p, &assigned, &outcome);
        double middle = outcome.value;
        CHECK_NEAR(outcome.upper, middle, 1e-12);
        CHECK_NEAR(outcome.lower, middle, 1e-12);
        fields_outcome(&fields, &complex, &star, &map, p, &assigned, &outcome);
        CHECK_NEAR(outcome.upper, sign > 0 ? middle + 2 : middle, 1e-12);
        CHECK_NEAR(outcome.lower, sign > 0 ? middle : middle - 2, 1e-12);
        boundary_map_fini(&map);
        star_fini(&star);
        fields_fini(&fields);
        complex_fini(&complex);
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
