/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The exact limit on random contractions: what the envelope accepts it accepts; its error of one contraction is the overlay's
 * largest difference, and of many an upper bound of it; what it refuses for a limit has no value within that limit.
 */
#include "src/simplify/exact/exact.h"

#include <stdlib.h>

#include "src/simplify/boundary.h"
#include "src/simplify/candidates.h"
#include "src/measure/overlay.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/test.h"

/* What there is of a mesh that is contracted at random. */
struct world {
    struct boundary_map map;
    struct tetmesh mesh;
    struct complex complex;
    struct fields fields;
    struct boundary boundary;
    struct overlaps overlaps;
    struct examiner examiner;
    struct star star;
    uint64_t random;
    double p[3];
};

/* A sample with float64 values of a bent field; vertices inside are moved. */
static bool open_world(struct world *world, const char *name, uint32_t size, uint64_t seed)
{
    *world = (struct world){.random = seed};
    struct tetmesh *mesh = &world->mesh;
    if (sample_find(name)->make(mesh, size, NULL) != TETLOD_OK ||
        complex_init(&world->complex, mesh, NULL) != TETLOD_OK)
        return false;
    mesh->position_type = mesh->fields[0].type = world->complex.position_type = TETLOD_FLOAT64;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        double *p = mesh->positions + 3 * (size_t)v;
        for (int i = 0; i < 3 && !(world->complex.flags[v] & VERTEX_BOUNDARY) && strcmp(name, "cube") == 0; i++)
            p[i] += 0.3 * (gen_unit(&world->random) - 0.5);
        memcpy(world->complex.positions + 3 * (size_t)v, p, 24);
        mesh->fields[0].values[v] = sin(p[0] + 2 * p[1]) + p[2] * p[0] + 0.1 * gen_unit(&world->random);
    }
    return fields_init(&world->fields, mesh, (uint32_t[]){0}, 1, NULL, NULL) == TETLOD_OK &&
           boundary_init(&world->boundary, &world->complex, 0.01, 1e-9, 0, NULL) == TETLOD_OK &&
           overlaps_init(&world->overlaps, mesh, NULL) == TETLOD_OK &&
           examiner_init(&world->examiner, &world->complex, &world->fields, NULL) == TETLOD_OK;
}

static void close_world(struct world *world)
{
    examiner_fini(&world->examiner);
    overlaps_fini(&world->overlaps);
    boundary_fini(&world->boundary);
    fields_fini(&world->fields);
    complex_fini(&world->complex);
    star_fini(&world->star);
    boundary_map_fini(&world->map);
    tetmesh_fini(&world->mesh);
}

/* Gathers the star of a random edge, face or tetrahedron and picks one of its candidates, or a point near it. False: it may
 * not be contracted there. */
static bool pick(struct world *world)
{
    struct complex *complex = &world->complex;
    uint32_t tet = (uint32_t)(gen_random(&world->random) % complex->tets_stored);
    uint32_t count = (uint32_t[]){2, 2, 2, 3, 4}[gen_random(&world->random) % 5];
    uint32_t candidate = (uint32_t)(gen_random(&world->random) % candidates_count(count, MOST_CANDIDATES));
    uint32_t simplex[4], first = (uint32_t)(gen_random(&world->random) % 4);
    uint8_t flags = 0;
    if (complex->corners[4 * (size_t)tet] == TETLOD_NONE)
        return false;
    for (uint32_t s = 0; s < count; s++) {
        simplex[s] = complex->corners[4 * (size_t)tet + (first + s) % 4];
        flags |= complex->flags[simplex[s]];
    }
    if (flags & (VERTEX_FROZEN | VERTEX_SINGULAR) || star_gather(&world->star, complex, simplex, count, NULL) != TETLOD_OK)
        return false;
    const double *weights = candidates_weights(count, candidate), *a = complex->positions + 3 * (size_t)simplex[0];
    bool free = !(flags & VERTEX_BOUNDARY) && gen_random(&world->random) % 4 == 0, whole = false, holds;
    for (int i = 0; i < 3; i++) {
        world->p[i] = a[i] + (free ? 0.2 * (gen_unit(&world->random) - 0.5) : 0);
        for (uint32_t s = 1; s < count; s++)
            world->p[i] += weights[s] * (complex->positions[3 * (size_t)simplex[s] + (size_t)i] - a[i]);
    }
    for (uint32_t s = 0; s < count && !free && !whole; s++)
        if ((whole = weights[s] == 1))
            memcpy(world->p, complex->positions + 3 * (size_t)simplex[s], 24);
    return boundary_allows(&world->boundary, complex, &world->star, weights, world->p) &&
           boundary_moves(&world->boundary, complex, &world->star, world->p, &world->map) <= world->boundary.limit &&
           star_fits(&world->star, complex, world->p) &&
           star_link_condition(&world->star, complex, &holds, NULL) == TETLOD_OK && holds;
}

/* Moves the picked position almost into the plane of the star's last link face: its cone becomes as flat as rounded positions make
 * them. False: then others fold. */
static bool flatten(struct world *world)
{
    const struct star *star = &world->star;
    const struct complex *complex = &world->complex;
    uint32_t i = star->tet_count - 1;
    double normal[3], to[3], left = pow(10, -5 - 3 * gen_unit(&world->random));
    const double *face[3];
    while (star->moving[i] == STAR_REMOVED)
        i--;
    for (int k = 0; k < 3; k++)
        face[k] = complex->positions + 3 * (size_t)complex->corners[4 * (size_t)star->tets[i] + tet_faces[star->moving[i]][k]];
    triangle_cross(face[0], face[1], face[2], normal);
    subtract(world->p, face[0], to);
    double height = dot(normal, to) / dot(normal, normal);
    for (int k = 0; k < 3; k++)
        world->p[k] -= (1 - left) * height * normal[k];
    return star_fits(star, complex, world->p);
}

static bool has_edge(const struct cover *cover, uint32_t a, uint32_t b)
{
    for (uint32_t i = 0; i < cover->edge_count; i++)
        if (cover->edges[i][0] == (a < b ? a : b) && cover->edges[i][1] == (a < b ? b : a))
            return true;
    return false;
}

/* All edges of the cover's originals are listed, each once. */
static void check_edges(const struct cover *cover)
{
    uint32_t missing = 0, twice = 0;
    for (uint32_t t = 0; t < cover->tet_count; t++)
        for (int e = 0; e < 6; e++)
            missing += !has_edge(cover, cover->corners[t][tet_edges[e][0]], cover->corners[t][tet_edges[e][1]]);
    for (uint32_t i = 0; i < cover->edge_count; i++)
        for (uint32_t j = 0; j < i; j++)
            twice += !memcmp(cover->edges[i], cover->edges[j], sizeof *cover->edges);
    CHECK_INT(missing, 0);
    CHECK_INT(twice, 0);
}

/* After all vertices were placed: the distances that are computed anew have the signs by which all is sorted, and no marks are left. */
static void check_cover(const struct world *world)
{
    const struct cover *cover = &world->examiner.cover;
    uint32_t wrong = 0, marks = 0;
    for (uint32_t v = 0; v < cover->vertex_count; v++)
        for (uint32_t w = 0; w < cover->wall_count; w++)
            wrong += (cover_distance(cover, w, cover->offsets[v]) >= cover->thresholds[w]) !=
                     (cover_side(cover, v, POSITIVE)[w / 64] >> w % 64 & 1);
    for (uint32_t i = 0; i < (world->mesh.tet_count + 63) / 64; i++)
        marks += cover->listed[i] || cover->covered[i];
    for (uint32_t v = 0; v < world->mesh.vertex_count; v++)
        marks += cover->numbers[v] != TETLOD_NONE;
    CHECK_INT(wrong, 0);
    CHECK_INT(marks, 0);
    check_edges(cover);
}

/* Examines the picked contraction. */
static struct finding examine(struct world *world, double limit)
{
    struct finding finding = {.error = NAN};
    if (exact_begin(&world->examiner, &world->complex, &world->fields, &world->star, NULL) != TETLOD_OK ||
        exact_examine(&world->examiner, &world->overlaps, &world->complex, &world->fields, &world->star, world->p,
                      limit, INFINITY, true, &finding, NULL) != TETLOD_OK)
        TEST_FAIL("out of memory");
    if (finding.allowed)
        check_cover(world);
    return finding;
}

static void contract(struct world *world, struct outcome *outcome)
{
    struct passed passed = {0};
    CHECK_INT(exact_pass_on(&world->examiner, &world->complex, &passed, NULL), TETLOD_OK);
    CHECK_INT(overlaps_take(&world->overlaps, &world->star, &passed, NULL), TETLOD_OK);
    passed_fini(&passed);
    fields_contract(&world->fields, &world->complex, &world->star, world->p, outcome);
    CHECK_INT(complex_contract(&world->complex, &world->star, world->p, NULL), TETLOD_OK);
    boundary_update(&world->boundary, &world->complex, world->star.simplex[0], 0, 1e-9);
}

/* Gives what is left new numbers, as the builder does in between. */
static void renumber(struct world *world)
{
    struct renumbering tets, slots;
    CHECK(complex_find_numbers(&world->complex, &tets, &slots) && complex_renumber(&world->complex, &tets, &slots));
    fields_renumber(&world->fields, &tets, &slots);
    boundary_renumber(&world->boundary, &slots);
    overlaps_renumber(&world->overlaps, &tets);
    cover_renumber(&world->examiner.cover, &slots);
    renumbering_fini(&tets);
    renumbering_fini(&slots);
}

/* The overlay's largest difference of the level from the original, as a fraction of the range. */
static double overlay_error(const struct world *world)
{
    struct tetmesh level = world->mesh;
    struct point_field field = world->mesh.fields[0];
    struct overlay_report report = {0};
    double error = NAN;
    level.positions = world->complex.positions;
    level.corners = malloc(16 * (size_t)world->complex.tets_stored);
    level.tet_count = 0;
    level.fields = &field;
    field.values = world->fields.fields[0].values;
    for (uint32_t t = 0; t < world->complex.tets_stored && level.corners; t++)
        if (world->complex.corners[4 * (size_t)t] != TETLOD_NONE)
            memcpy(level.corners + 4 * (size_t)level.tet_count++, world->complex.corners + 4 * (size_t)t, 16);
    if (!level.corners || overlay_max(&level, (uint32_t[]){0}, &world->mesh, (uint32_t[]){0}, 1, &(struct overlay_options){.threads = 1}, &error, &report, NULL) != TETLOD_OK)
        TEST_FAIL("out of memory");
    free(level.corners);
    return error * world->fields.drivers[0].scale;
}

/* Random contractions that the envelope gives at most `most`; each must be accepted at the largest of the envelope's errors so
 * far, with the same value. In the end the overlay finds no more than what was found on the way. */
static void check_envelope(const char *name, uint32_t size, uint64_t seed, double most, int contractions)
{
    struct world world;
    int done = 0, refused = 0, sharper = 0;
    double largest = 0, bound = 0;
    REQUIRE(open_world(&world, name, size, seed));
    for (int i = 0; i < 200000 && done < contractions; i++) {
        struct outcome outcome;
        if (!pick(&world))
            continue;
        fields_outcome(&world.fields, &world.complex, &world.star, &world.map, world.p, (double[]){NAN}, &outcome);
        double envelope = outcome_error(&world.fields, &outcome);
        if (!(envelope > 0 && envelope <= most))
            continue;
        double limit = larger(envelope, bound);
        struct finding finding = examine(&world, limit);
        refused += !finding.allowed;
        sharper += finding.error < 0.9 * limit;
        if (!finding.allowed || !(finding.error <= limit * (1 + 1e-6)))
            TEST_FAIL("%s, contraction %d: envelope %.12g, exact %.12g", name, done, limit, finding.error);
        if (gen_random(&world.random) % 4)
            continue;
        largest = larger(largest, finding.error);
        bound = limit;
        outcome.value = world.examiner.chosen[0];
        contract(&world, &outcome);
        done++;
    }
    CHECK_INT(refused, 0);
    CHECK(done == contractions && sharper > 0);
    double truth = overlay_error(&world);
    if (!(truth <= largest * (1 + 1e-6)))
        TEST_FAIL("%s: the overlay finds %g, more than %g", name, truth, largest);
    printf("# %s %u: %d contractions, overlay %g, exact %g\n", name, size, done, truth, largest);
    close_world(&world);
}

static void test_what_the_envelope_accepts(void)
{
    check_envelope("cube", 5, 1, 0.3, 60);
    check_envelope("cube", 6, 2, 1, 150);
    check_envelope("torus", 4, 3, 0.2, 60);
    check_envelope("fin", 6, 4, 0.1, 100);
    check_envelope("delta", 2, 5, 0.2, 60);
}

/* One contraction of the original: the exact error is the overlay's, from above and below but for what rounding may come to in
 * thin tetrahedra; and just below it there is no value at all. */
static void test_one_contraction(void)
{
    int done = 0;
    for (uint64_t seed = 1; seed < 40; seed++) {
        struct world world;
        REQUIRE(open_world(&world, seed % 2 ? "cube" : "delta", seed % 2 ? 4 : 2, seed));
        for (int tries = 0; tries < 100000; tries++) {
            if (!pick(&world))
                continue;
            struct finding least = examine(&world, 0); // refused: its bound is the least error of all values
            CHECK(!least.allowed);
            struct finding finding = examine(&world, least.error * (1 + 1e-4));
            CHECK(finding.allowed);
            CHECK_NEAR(finding.error, least.error, 3e-4 * least.error);
            CHECK(!examine(&world, least.error * (1 - 1e-4)).allowed);
            finding = examine(&world, 2 * least.error);
            struct outcome outcome = {.value = world.examiner.chosen[0], .upper = 0, .lower = 0};
            contract(&world, &outcome);
            CHECK_NEAR(overlay_error(&world), finding.error, 1e-4 * finding.error);
            done++;
            break;
        }
        close_world(&world);
    }
    CHECK(done > 30);
}

/* A linear field whose values are rounded: what a contraction is off by is largest at its result. */
static void test_the_result_counts(void)
{
    struct world world;
    int done = 0;
    REQUIRE(open_world(&world, "cube", 4, 3));
    for (uint32_t v = 0; v < world.mesh.vertex_count; v++) {
        const double *p = world.mesh.positions + 3 * (size_t)v;
        world.mesh.fields[0].values[v] = p[0] + 2 * p[1] - p[2];
    }
    fields_fini(&world.fields);
    examiner_fini(&world.examiner);
    REQUIRE(fields_init(&world.fields, &world.mesh, (uint32_t[]){0}, 1, NULL, NULL) == TETLOD_OK &&
            examiner_init(&world.examiner, &world.complex, &world.fields, NULL) == TETLOD_OK);
    struct working_field *field = &world.fields.fields[0];
    field->grid = (struct grid){8, field->component_range[0][0], 0.25, 255};
    for (int tries = 0; tries < 5000; tries++) {
        if (!pick(&world))
            continue;
        struct finding finding = examine(&world, 10);
        double there = fabs(world.examiner.chosen[0] - (world.p[0] + 2 * world.p[1] - world.p[2])) * world.fields.drivers[0].scale;
        CHECK(finding.allowed && there <= finding.error * (1 + 1e-9) + 1e-12);
        done += there > 1e-3;
    }
    CHECK(done > 200);
    close_world(&world);
}

/* As many contractions within a limit as there are in so many tries, far beyond what the envelope would allow: the overlay holds
 * it. A part of them makes flat cones, whose walls are almost one plane. */
static void check_sequence(const char *name, uint32_t size, uint64_t seed, int tries, bool flat)
{
    struct world world;
    const double limit = 0.05, still[4] = {0};
    double envelope = 0;
    int done = 0;
    REQUIRE(open_world(&world, name, size, seed));
    for (int i = 0; i < tries; i++) {
        struct outcome outcome;
        if (!pick(&world) || (flat && i % 2 && !(flatten(&world) && boundary_allows(&world.boundary, &world.complex, &world.star, still, world.p))))
            continue;
        struct finding finding = examine(&world, limit);
        CHECK(finding.allowed ? finding.error <= limit * (1 + 1e-9) : finding.error > limit * (1 - (flat ? 1e-3 : 1e-6)));
        if (!finding.allowed)
            continue;
        fields_outcome(&world.fields, &world.complex, &world.star, &world.map, world.p, world.examiner.chosen, &outcome);
        envelope = larger(envelope, outcome_error(&world.fields, &outcome));
        contract(&world, &outcome);
        done++;
        if (done % 8 == 0)
            renumber(&world);
        CHECK(!(flat && i % 2) || overlay_error(&world) <= limit * (1 + 1e-6));
    }
    double truth = overlay_error(&world);
    printf("# %s %u: %d contractions, overlay %g, envelope %g\n", name, size, done, truth, envelope);
    CHECK(done > 20 && envelope > 2 * limit);
    CHECK(truth <= limit * (1 + 1e-6) && truth > 0.8 * limit);
    close_world(&world);
}

static void test_sequences(void)
{
    check_sequence("cube", 6, 77, 30000, false);
    check_sequence("torus", 4, 77, 30000, false);
    check_sequence("fin", 5, 77, 30000, false);
    check_sequence("delta", 2, 77, 30000, false);
    for (uint64_t seed = 1; seed < 31; seed++)
        check_sequence("cube", 5, seed, 8000, true);
}

int main(void)
{
    RUN(test_what_the_envelope_accepts);
    RUN(test_one_contraction);
    RUN(test_the_result_counts);
    RUN(test_sequences);
    return test_end();
}
