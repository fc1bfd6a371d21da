/* SPDX-License-Identifier: BSD-3-Clause */
/* Errors that are known beforehand. */
#include "src/measure/measure_levels.h"
#include "src/mesh/adjacency.h"

#include <stdlib.h>

#include "tests/ancestry.h"
#include "src/measure/boundary_check.h"
#include "src/pipeline/quantise.h"
#include "src/simplify/simplify.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/pyramid.h"
#include "tests/test.h"

static const uint32_t first_field[1] = {0};

static struct measured compare(const struct tetmesh *a, const struct tetmesh *b, unsigned threads, double *domain)
{
    struct measured out = {-1, -1};
    struct measure *measure;
    CHECK_INT(measure_new(&measure, a, first_field, 1, threads, NULL), TETLOD_OK);
    if (measure)
        CHECK_INT(measure_mesh(measure, b, first_field, threads, &out, domain, NULL), TETLOD_OK);
    measure_free(measure);
    return out;
}

static void make(struct tetmesh *mesh, const char *name, uint32_t size)
{
    CHECK_INT(sample_find(name)->make(mesh, size, NULL), TETLOD_OK);
}

static void test_the_same(void)
{
    for (const struct sample *sample = samples; sample->name; sample++) {
        struct tetmesh mesh = {0};
        double domain, range[2];
        make(&mesh, sample->name, sample->least_size > 2 ? sample->least_size : 2);
        struct measured m = compare(&mesh, &mesh, 2, &domain);
        point_field_range(&mesh.fields[0], mesh.vertex_count, range);
        CHECK_NEAR(m.sampled, 0, 1e-12 * (range[1] - range[0]));
        CHECK_NEAR(m.rms, 0, 1e-12 * (range[1] - range[0]));
        CHECK_NEAR(domain, 0, 1e-12 * mesh_diagonal(&mesh));
        tetmesh_fini(&mesh);
    }
}

static void test_raised_by_a_constant(void)
{
    struct tetmesh a = {0}, b = {0};
    double domain;
    make(&a, "torus", 2);
    make(&b, "torus", 2);
    for (uint32_t v = 0; v < b.vertex_count; v++)
        b.fields[0].values[v] += 0.25;
    struct measured m = compare(&a, &b, 2, &domain);
    CHECK_NEAR(m.sampled, 0.25, 1e-9);
    CHECK_NEAR(m.rms, 0.25, 1e-9);
    tetmesh_fini(&a);
    tetmesh_fini(&b);
}

/* Fields of a constant, of tiny and of huge values: sums neither vanish nor overflow. */
static void test_any_magnitude(void)
{
    static const double magnitudes[] = {1e-300, 1e-12, 1, 1e12, 1e300};
    for (size_t i = 0; i < sizeof magnitudes / sizeof *magnitudes; i++)
        for (int constant = 0; constant < 2; constant++) {
            struct tetmesh a = {0}, b = {0};
            double domain, magnitude = magnitudes[i];
            make(&a, "cube", 3);
            make(&b, "cube", 3);
            for (uint32_t v = 0; v < b.vertex_count; v++) {
                a.fields[0].values[v] = magnitude * (constant ? 1 : v % 3);
                b.fields[0].values[v] = a.fields[0].values[v] + (constant ? 0 : magnitude);
            }
            struct measured m = compare(&a, &b, 2, &domain);
            CHECK_NEAR(m.sampled, constant ? 0 : magnitude, 1e-12 * magnitude);
            CHECK_NEAR(m.rms, constant ? 0 : magnitude, 1e-12 * magnitude);
            tetmesh_fini(&a);
            tetmesh_fini(&b);
        }
}

/* One vertex raised: the largest difference is there. */
static void test_raised_at_a_vertex(void)
{
    struct tetmesh a = {0}, b = {0};
    double domain;
    make(&a, "cube", 4);
    make(&b, "cube", 4);
    b.fields[0].values[62] += 3;
    struct measured m = compare(&a, &b, 2, &domain);
    CHECK_NEAR(m.sampled, 3, 1e-12);
    CHECK(m.rms > 0.05 && m.rms < 1.5);
    tetmesh_fini(&a);
    tetmesh_fini(&b);
}

/* A cube moved along x, with the field x of the place: what it held is compared at the closest point. */
static void test_displaced(void)
{
    struct tetmesh a = {0}, b = {0};
    double domain;
    make(&a, "cube", 4);
    make(&b, "cube", 4);
    for (uint32_t v = 0; v < a.vertex_count; v++) {
        a.fields[0].values[v] = a.positions[3 * v];
        b.positions[3 * v] += 0.5;
        b.fields[0].values[v] = b.positions[3 * v];
    }
    struct measured m = compare(&a, &b, 2, &domain);
    CHECK_NEAR(m.sampled, 0.5, 1e-12); // at x = 0, whose closest point has the value of x = 1/2
    CHECK_NEAR(domain, 0.5, 1e-12);
    for (uint32_t v = 0; v < a.vertex_count; v++)
        b.fields[0].values[v] = a.fields[0].values[v];
    m = compare(&a, &b, 2, &domain);
    CHECK_NEAR(m.sampled, 0.5, 1e-12); // now the values have moved along
    tetmesh_fini(&a);
    tetmesh_fini(&b);
}

/* The middle of a unit cube's field x y z against a single vertex less: the trilinear value at 8 corners is kept. */
static void test_coarse_against_fine(void)
{
    struct tetmesh fine = {0}, coarse = {0};
    double domain;
    make(&fine, "cube", 2);
    make(&coarse, "cube", 1);
    for (uint32_t v = 0; v < coarse.vertex_count; v++) {
        for (int d = 0; d < 3; d++)
            coarse.positions[3 * v + d] *= 2;
        coarse.fields[0].values[v] *= 8;
    }
    struct measured m = compare(&fine, &coarse, 1, &domain);
    CHECK_NEAR(m.sampled, 3, 1e-12); // at the centre: 1 against the diagonal's middle, 4
    CHECK_NEAR(domain, 0, 1e-12);
    tetmesh_fini(&fine);
    tetmesh_fini(&coarse);
}

static void test_threads_do_not_matter(void)
{
    struct tetmesh a = {0}, b = {0};
    double domain[2];
    make(&a, "fin", 8);
    make(&b, "fin", 5);
    struct measured one = compare(&a, &b, 1, &domain[0]);
    CHECK(one.sampled > 0 && one.rms > 0 && one.rms < one.sampled && domain[0] > 0);
    for (unsigned threads = 2; threads < 6; threads++) {
        struct measured many = compare(&a, &b, threads, &domain[1]);
        CHECK(memcmp(&one, &many, sizeof one) == 0);
        CHECK(domain[0] == domain[1]);
    }
    tetmesh_fini(&a);
    tetmesh_fini(&b);
}

/* The corners of a tetrahedron, vertices and tetrahedra in another order: the same samples. */
static void test_order_does_not_matter(void)
{
    struct tetmesh a = {0}, b = {0}, level = {0};
    double domain[2];
    make(&a, "cube", 5);
    make(&b, "cube", 5);
    make(&level, "cube", 1);
    for (int i = 0; i < 24; i++)
        level.positions[i] *= 5;
    for (uint32_t v = 0; v < a.vertex_count; v++) {
        uint32_t to = a.vertex_count - 1 - v;
        memcpy(b.positions + 3 * to, a.positions + 3 * v, 3 * sizeof(double));
        b.fields[0].values[to] = a.fields[0].values[v];
    }
    for (uint32_t t = 0; t < a.tet_count; t++)
        for (uint32_t c = 0; c < 4; c++) // turned around corner 3
            b.corners[4 * (a.tet_count - 1 - t) + (c == 3 ? 3 : (c + 1) % 3)] =
                a.vertex_count - 1 - a.corners[4 * t + c];
    struct measured first = compare(&a, &level, 1, &domain[0]), second = compare(&b, &level, 1, &domain[1]);
    CHECK(first.sampled > 1);
    CHECK_NEAR(first.sampled, second.sampled, 1e-12 * first.sampled);
    CHECK_NEAR(first.rms, second.rms, 1e-12 * first.rms);
    CHECK_NEAR(domain[0], domain[1], 1e-12);
    tetmesh_fini(&a);
    tetmesh_fini(&b);
    tetmesh_fini(&level);
}

/* A coarsening that goes along with an ancestry has the same mesh, whatever its threads and numbers. */
static void check_coarsening(const struct coarsening *c, const struct ancestry_level *level, const uint32_t *number)
{
    uint32_t wrong = 0;
    CHECK_INT(c->tets, level->mesh.tet_count);
    for (uint32_t t = 0, k = 0; t < c->stored && k < level->mesh.tet_count; t++) {
        if (c->states[t] >= COARSE_DIED)
            continue;
        for (size_t i = 0; i < 4; i++) {
            uint32_t slot = c->corners[4 * (size_t)t + i], v = level->mesh.corners[4 * (size_t)k + i];
            uint32_t expected = level->neighbours[4 * (size_t)k + i];
            uint32_t across = c->neighbours ? c->neighbours[4 * (size_t)t + i] : expected;
            wrong += memcmp(c->positions + 3 * (size_t)slot, level->mesh.positions + 3 * (size_t)v, 24) != 0;
            wrong += c->fields[0].values[slot] != level->mesh.fields[0].values[v];
            wrong += (c->slots[slot] == SLOT_ORIGINAL) != (level->nodes[v] == slot);
            wrong += c->states[c->tet_of[slot]] >= COARSE_DIED;
            wrong += !c->neighbours || across == TETLOD_NONE ? expected != across
                                                             : expected != 4 * number[across / 4] + across % 4;
        }
        k++;
    }
    CHECK_INT(wrong, 0);
}

/* Numbers of the living tetrahedra. */
static uint32_t *number_living(const struct coarsening *c)
{
    uint32_t *number = malloc((size_t)c->stored * sizeof *number), count = 0;
    for (uint32_t t = 0; t < c->stored && number; t++)
        number[t] = c->states[t] < COARSE_DIED ? count++ : TETLOD_NONE;
    return number;
}

/* An error is kept as a float that is not below it. */
static void check_kept(double kept, double measured, double range)
{
    CHECK(kept >= measured - 1e-9 * range);
    CHECK_NEAR(kept, measured, 1.2e-7 * measured + 1e-9 * range);
}

/* Level by level, where only what has changed is measured again, gives what measuring each level anew gives: bit by bit
 * the same on any number of threads. Also where the levels are of a rounded copy of the mesh. */
static void check_levels(const char *sample, uint32_t size, double boundary_limit, unsigned bits)
{
    struct tetmesh mesh = {0}, rounded = {0};
    make(&mesh, sample, size);
    if (bits)
        REQUIRE(quantise_mesh(&rounded, &mesh, &(struct quantise_options){bits, bits, 0, 0}, NULL) == TETLOD_OK);
    const struct tetmesh *contracted = bits ? &rounded : &mesh;
    struct simplify_options options = {.metric = METRIC_ENVELOPE, .contract = CONTRACT_EDGES, .max_error = 1,
                                       .min_tets = 1,
                                       .boundary_angle = 30, .boundary_limit = boundary_limit * mesh_diagonal(&mesh),
                                       .growth = 1.3, .threads = 1};
    enum { WAYS = 3 };
    struct contraction_log s;
    struct ancestry ancestry;
    struct coarsening coarsenings[WAYS];
    struct measure_levels *steps[WAYS];
    double range[2], most = 0, diagonal = mesh_diagonal(&mesh);
    point_field_range(&mesh.fields[0], mesh.vertex_count, range);
    REQUIRE(simplify(&s, contracted, first_field, 1, NULL, &options, NULL) == TETLOD_OK);
    REQUIRE(mesh.field_count <= 4);
    REQUIRE(ancestry_init(&ancestry, &s, contracted, NULL) == TETLOD_OK);
    for (unsigned i = 0; i < WAYS; i++) {
        REQUIRE(coarsening_init(&coarsenings[i], contracted, &s, NULL) == TETLOD_OK);
        if (i) // on the other one steps come before anybody asks
            REQUIRE(coarsening_need_neighbours(&coarsenings[i], NULL) == TETLOD_OK);
        REQUIRE(measure_levels_new(&steps[i], &mesh, &coarsenings[i], i + 1, NULL) == TETLOD_OK);
    }
    for (uint32_t m = 0; m < s.mark_count; m++) {
        struct ancestry_level level;
        struct measured step[WAYS][4]; // of each field
        // measured; with what the contraction has proved; measured
        double domain[WAYS] = {0, s.marks[m].moved, 0}, anew = 0;
        REQUIRE(ancestry_level(&ancestry, s.marks[m].contractions, &level, NULL) == TETLOD_OK);
        for (unsigned i = 0; i < WAYS; i++) {
            if (m)
                REQUIRE(coarsening_advance(&coarsenings[i], &s, s.marks[m].contractions, i + 1, NULL) == TETLOD_OK);
            uint32_t *number = number_living(&coarsenings[i]);
            REQUIRE(number);
            check_coarsening(&coarsenings[i], &level, number);
            free(number);
            CHECK_INT(measure_levels_next(steps[i], step[i], &domain[i], NULL), TETLOD_OK);
        }
        struct measured whole = compare(&mesh, &level.mesh, 2, &anew);
        most = anew > most ? anew : most;
        CHECK(memcmp(step[0], step[1], mesh.field_count * sizeof step[0][0]) == 0 &&
              memcmp(step[0], step[2], mesh.field_count * sizeof step[0][0]) == 0);
        check_kept(step[0][0].sampled, whole.sampled, range[1] - range[0]);
        check_kept(step[0][0].rms, whole.rms, range[1] - range[0]);
        CHECK(domain[0] == domain[2]);
        CHECK_NEAR(domain[0], most, 1e-12 * diagonal);
        CHECK_NEAR(domain[1], most > s.marks[m].moved ? most : s.marks[m].moved, 1e-12 * diagonal);
        ancestry_level_fini(&level);
    }
    CHECK(bits || (most > 1e-6 * diagonal) == (boundary_limit > 1e-6));
    for (unsigned i = 0; i < WAYS; i++) {
        measure_levels_free(steps[i]);
        coarsening_fini(&coarsenings[i]);
    }
    ancestry_fini(&ancestry);
    log_fini(&s);
    tetmesh_fini(&mesh);
    tetmesh_fini(&rounded);
}

static void test_levels_of_a_sequence(void)
{
    check_levels("cube", 5, 1e-6, 0);
    check_levels("fin", 6, 1e-6, 0);
}

static void test_levels_with_a_boundary_that_moves(void)
{
    check_levels("torus", 4, 1e-2, 0);
    check_levels("shell", 5, 1e-2, 0);
}

static void test_levels_of_a_rounded_mesh(void)
{
    check_levels("cube", 5, 1e-6, 7);
    check_levels("torus", 4, 1e-2, 9);
}

/* A level that promises less than the one before is looked at as a whole, whatever changed in between. */
static void test_boundary_of_a_stricter_level(void)
{
    struct pyramid original, level;
    struct boundary_check *check;
    const uint8_t touched[6] = {0};
    uint32_t neighbours[64];
    double distance;
    pyramid_init(&original);
    pyramid_init(&level);
    REQUIRE(level.mesh.tet_count <= 16 && adjacency_build(level.mesh.corners, level.mesh.tet_count,
                                                          level.mesh.vertex_count, neighbours, NULL,
                                                          NULL) == TETLOD_OK);
    level.positions[2] = 0;
    REQUIRE(boundary_check_new(&check, &original.mesh, NULL, 1, NULL) == TETLOD_OK);
    REQUIRE(boundary_check_level(check, &level.mesh, neighbours, NULL, 0.3, &distance, NULL) == TETLOD_OK);
    CHECK(distance == 0);
    REQUIRE(boundary_check_level(check, &level.mesh, neighbours, touched, 0.3, &distance, NULL) == TETLOD_OK);
    CHECK(distance == 0);
    REQUIRE(boundary_check_level(check, &level.mesh, neighbours, touched, 0.1, &distance, NULL) == TETLOD_OK);
    CHECK_NEAR(distance, 0.25, 1e-12);
    boundary_check_free(check);
}

int main(void)
{
    RUN(test_the_same);
    RUN(test_raised_by_a_constant);
    RUN(test_any_magnitude);
    RUN(test_raised_at_a_vertex);
    RUN(test_displaced);
    RUN(test_coarse_against_fine);
    RUN(test_threads_do_not_matter);
    RUN(test_order_does_not_matter);
    RUN(test_levels_of_a_sequence);
    RUN(test_levels_with_a_boundary_that_moves);
    RUN(test_levels_of_a_rounded_mesh);
    RUN(test_boundary_of_a_stricter_level);
    return test_end();
}
