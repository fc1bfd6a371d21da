/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The exact limit on random contractions: what the envelope accepts it accepts; its error of one contraction is the
 * overlay's largest difference, and of many an upper bound of it; what it refuses for a limit has no value within that
 * limit.
 */
#include "src/simplify/exact/examiner.h"

#include <stdlib.h>

#include "src/measure/overlay.h"
#include "src/mesh/tet_geom.h"
#include "src/mesh/vector.h"
#include "src/sample/sample.h"
#include "src/simplify/rounds/simplices.h"
#include "tests/gen.h"
#include "tests/test.h"
#include "tests/world.h"

/* A mesh that is contracted at random, and the exact limit of it. */
struct exact_world {
    struct world world;
    struct tetmesh mesh;
    struct overlaps overlaps;
    struct examiner examiner;
    struct join join; /* what was picked */
    uint64_t random;
};

/* A sample with float64 values of a bent field; vertices inside are moved. */
static bool open_exact(struct exact_world *exact, const char *name, uint32_t size, uint64_t seed)
{
    const struct world_options options = {.controlled = (uint32_t[]){0}, .controlled_count = 1, .angle = 0.01,
                                          .boundary_limit = 1e-9};
    *exact = (struct exact_world){.random = seed};
    struct tetmesh *mesh = &exact->mesh;
    struct world plain;
    if (sample_find(name)->make(mesh, size, NULL) != TETLOD_OK || !world_open_plain(&plain, mesh))
        return false;
    mesh->position_type = mesh->fields[0].type = TETLOD_FLOAT64;
    for (uint32_t slot = 0; slot < plain.working.slot_count; slot++) {
        uint32_t v = plain.working.node[slot];
        double *p = mesh->positions + 3 * (size_t)v;
        for (int i = 0; i < 3 && !(plain.working.flags[slot] & VERTEX_BOUNDARY) && strcmp(name, "cube") == 0; i++)
            p[i] += 0.3 * (gen_unit(&exact->random) - 0.5);
        mesh->fields[0].values[v] = sin(p[0] + 2 * p[1]) + p[2] * p[0] + 0.1 * gen_unit(&exact->random);
    }
    world_close(&plain);
    return world_open(&exact->world, mesh, &options) &&
           overlaps_init(&exact->overlaps, mesh, &exact->world.working, NULL) == TETLOD_OK &&
           examiner_init(&exact->examiner, &exact->world.working, NULL) == TETLOD_OK;
}

static void close_exact(struct exact_world *exact)
{
    examiner_fini(&exact->examiner);
    overlaps_fini(&exact->overlaps);
    world_close(&exact->world);
    tetmesh_fini(&exact->mesh);
}

/* Gathers the star of a random edge, face or tetrahedron and picks one of its vertices, its centre, or a point near it.
 * False: it may not be contracted there. */
static bool pick(struct exact_world *exact)
{
    struct world *world = &exact->world;
    struct working *working = &world->working;
    struct border *border = &world->run.border;
    struct join *join = &exact->join;
    uint32_t tet = (uint32_t)(gen_random(&exact->random) % working->tet_count), flags = 0;
    join->count = (uint32_t[]){2, 2, 2, 3, 4}[gen_random(&exact->random) % 5];
    uint32_t candidate = (uint32_t)(gen_random(&exact->random) % (join->count + 1));
    double weights[4];
    bool room;
    if (!world_pick(world, tet, (uint32_t)(gen_random(&exact->random) % 4), join->count, join->simplex) ||
        !star_gather(&world->star, working, join->simplex, join->count))
        return false;
    for (uint32_t s = 0; s < join->count; s++)
        flags |= working->flags[join->simplex[s]];
    bool free = !(flags & VERTEX_BOUNDARY) && gen_random(&exact->random) % 4 == 0;
    for (uint32_t s = 0; s < 4; s++)
        weights[s] = candidate == join->count ? 1.0 / join->count : s == candidate;
    simplex_position(&world->run, join, candidate, join->p);
    for (int i = 0; i < 3 && free; i++)
        join->p[i] += 0.2 * (gen_unit(&exact->random) - 0.5);
    return border_allows(border, working, join->simplex, join->count, weights, join->p) &&
           border_moves(border, working, join->simplex, join->count, join->p, &world->worker.map) <= border->limit &&
           star_fits(&world->star, working, join->p) && links_hold_star(&world->worker.links, &world->star, working,
                                                                        &room);
}

/* Moves the picked position almost into the plane of the star's last link face: its cone becomes as flat as rounded
 * positions make it. False: then others fold. */
static bool flatten(struct exact_world *exact)
{
    const struct star *star = &exact->world.star;
    const struct working *working = &exact->world.working;
    double *p = exact->join.p;
    uint32_t i = star->tet_count - 1;
    double normal[3], to[3], left = pow(10, -5 - 3 * gen_unit(&exact->random));
    const double *face[3];
    while (star->moving[i] == STAR_REMOVED)
        i--;
    for (int k = 0; k < 3; k++)
        face[k] = working_row(working, working->corners[star->tets[i]][tet_faces[star->moving[i]][k]]);
    triangle_cross(face[0], face[1], face[2], normal);
    subtract(p, face[0], to);
    double height = dot(normal, to) / dot(normal, normal);
    for (int k = 0; k < 3; k++)
        p[k] -= (1 - left) * height * normal[k];
    return star_fits(star, working, p);
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

/* After all vertices were placed: the distances that are computed anew have the signs by which all is sorted, and no
 * marks are left. */
static void check_cover(const struct exact_world *exact)
{
    const struct cover *cover = &exact->examiner.cover;
    uint32_t wrong = 0, marks = 0;
    for (uint32_t v = 0; v < cover->vertex_count; v++)
        for (uint32_t w = 0; w < cover->wall_count; w++)
            wrong += (cover_distance(cover, w, cover->offsets[v]) >= cover->thresholds[w]) !=
                     (cover_side(cover, v, POSITIVE)[w / 64] >> w % 64 & 1);
    for (uint32_t i = 0; i < (exact->mesh.tet_count + 63) / 64; i++)
        marks += cover->listed[i] || cover->covered[i];
    for (uint32_t v = 0; v < exact->mesh.vertex_count; v++)
        marks += cover->numbers[v] != TETLOD_NONE;
    CHECK_INT(wrong, 0);
    CHECK_INT(marks, 0);
    check_edges(cover);
}

/* Examines the picked contraction. */
static struct finding examine(struct exact_world *exact, double limit)
{
    struct finding finding = {.error = NAN};
    if (exact_begin(&exact->examiner, &exact->world.working, &exact->world.star, NULL) != TETLOD_OK ||
        exact_examine(&exact->examiner, &exact->overlaps, &exact->world.working, &exact->world.star, exact->join.p,
                      limit, INFINITY,
                      true, &finding, NULL) != TETLOD_OK)
        TEST_FAIL("out of memory");
    if (finding.allowed)
        check_cover(exact);
    return finding;
}

/* The bounds of the envelope for the picked contraction: U and L stay in the worker's numbers. */
static double envelope_of(struct exact_world *exact)
{
    const struct run *run = &exact->world.run;
    struct worker *worker = &exact->world.worker;
    exact->join.at_one_point = exact->world.star.at_one_point;
    CHECK(outcome_list(run, worker, &exact->join) && outcome_weigh(run, worker, &exact->join));
    outcome_bounds(run, worker, &exact->join);
    outcome_demands(run, worker);
    return outcome_middles(run, worker, NULL);
}

/* Contracts to the value that the examiner chose, with the U and L of envelope_of. */
static void contract(struct exact_world *exact)
{
    struct passed passed = {0};
    struct working *working = &exact->world.working;
    uint32_t kept = join_kept(&exact->join);
    CHECK_INT(exact_pass_on(&exact->examiner, working, &passed, NULL), TETLOD_OK);
    CHECK_INT(overlaps_take(&exact->overlaps, &exact->world.star, &passed, NULL), TETLOD_OK);
    free(passed.numbers);
    *working_values(working, kept, 0) = exact->examiner.chosen[0];
    working_row(working, kept)[ROW_FIELDS] = numbers_of(&exact->world.run, &exact->world.worker, NUMBERS_UPPER)[0];
    working_row(working, kept)[ROW_FIELDS + 1] = numbers_of(&exact->world.run, &exact->world.worker, NUMBERS_LOWER)[0];
    CHECK(world_contract(&exact->world, exact->join.p));
}

/* Gives what is left new numbers, as the rounds do in between. */
static void renumber(struct exact_world *exact)
{
    struct renumbering numbers;
    REQUIRE(working_renumber(&exact->world.working, &numbers, NULL) == TETLOD_OK);
    border_renumber(&exact->world.run.border, &numbers);
    overlaps_renumber(&exact->overlaps, &numbers);
    renumbering_fini(&numbers);
}

/* The overlay's largest difference of the level from the original, as a fraction of the range. */
static double overlay_error(const struct exact_world *exact)
{
    const struct working *working = &exact->world.working;
    struct tetmesh level = exact->mesh;
    struct point_field field = exact->mesh.fields[0];
    struct overlay_report report = {0};
    double error = NAN;
    level.vertex_count = working->slot_count;
    level.positions = malloc(24 * (size_t)working->slot_count);
    level.corners = malloc(16 * (size_t)working->tet_count);
    level.tet_count = 0;
    level.fields = &field;
    field.values = malloc(8 * (size_t)working->slot_count);
    if (!level.positions || !level.corners || !field.values) {
        TEST_FAIL("out of memory");
        return NAN;
    }
    for (uint32_t v = 0; v < working->slot_count; v++) {
        memcpy(level.positions + 3 * (size_t)v, working_row(working, v), 24);
        field.values[v] = *working_values(working, v, 0) + working->fields[0].middles[0];
    }
    for (uint32_t t = 0; t < working->tet_count; t++)
        if (!tet_gone(working, t))
            memcpy(level.corners + 4 * (size_t)level.tet_count++, working->corners[t], 16);
    CHECK_INT(overlay_max(&level, (uint32_t[]){0}, &exact->mesh, (uint32_t[]){0}, 1,
                          &(struct overlay_options){.threads = 1}, &error,
                          &report, NULL), TETLOD_OK);
    free(level.positions);
    free(level.corners);
    free(field.values);
    return error * working->components[0].scale;
}

/* Random contractions that the envelope gives at most `most`; each must be accepted at the largest of the envelope's
 * errors so far, with the same value. In the end the overlay finds no more than what was found on the way. */
static void check_envelope(const char *name, uint32_t size, uint64_t seed, double most, int contractions)
{
    struct exact_world exact;
    int done = 0, refused = 0, sharper = 0;
    double largest = 0, bound = 0;
    REQUIRE(open_exact(&exact, name, size, seed));
    for (int i = 0; i < 200000 && done < contractions; i++) {
        if (!pick(&exact))
            continue;
        double envelope = envelope_of(&exact);
        if (!(envelope > 0 && envelope <= most))
            continue;
        double limit = larger(envelope, bound);
        struct finding finding = examine(&exact, limit);
        refused += !finding.allowed;
        sharper += finding.error < 0.9 * limit;
        if (!finding.allowed || !(finding.error <= limit * (1 + 1e-6)))
            TEST_FAIL("%s, contraction %d: envelope %.12g, exact %.12g", name, done, limit, finding.error);
        if (gen_random(&exact.random) % 4)
            continue;
        largest = larger(largest, finding.error);
        bound = limit;
        contract(&exact);
        done++;
    }
    CHECK_INT(refused, 0);
    CHECK(done == contractions && sharper > 0);
    double truth = overlay_error(&exact);
    if (!(truth <= largest * (1 + 1e-6)))
        TEST_FAIL("%s: the overlay finds %g, more than %g", name, truth, largest);
    printf("# %s %u: %d contractions, overlay %g, exact %g\n", name, size, done, truth, largest);
    close_exact(&exact);
}

static void test_what_the_envelope_accepts(void)
{
    check_envelope("cube", 5, 1, 0.3, 60);
    check_envelope("cube", 6, 2, 1, 150);
    check_envelope("torus", 4, 3, 0.2, 60);
    check_envelope("fin", 6, 4, 0.1, 100);
    check_envelope("delta", 2, 5, 0.2, 60);
}

/* One contraction of the original: the exact error is the overlay's, from above and below but for what rounding may
 * come to in thin tetrahedra; and just below it there is no value at all. */
static void test_one_contraction(void)
{
    const uint64_t end = SANITIZED ? 12 : 40;
    int done = 0;
    for (uint64_t seed = 1; seed < end; seed++) {
        struct exact_world exact;
        REQUIRE(open_exact(&exact, seed % 2 ? "cube" : "delta", seed % 2 ? 4 : 2, seed));
        for (int tries = 0; tries < 100000; tries++) {
            if (!pick(&exact))
                continue;
            struct finding least = examine(&exact, 0); // refused: its bound is the least error of all values
            CHECK(!least.allowed);
            struct finding finding = examine(&exact, least.error * (1 + 1e-4));
            CHECK(finding.allowed);
            CHECK_NEAR(finding.error, least.error, 3e-4 * least.error);
            CHECK(!examine(&exact, least.error * (1 - 1e-4)).allowed);
            finding = examine(&exact, 2 * least.error);
            contract(&exact);
            CHECK_NEAR(overlay_error(&exact), finding.error, 1e-4 * finding.error);
            done++;
            break;
        }
        close_exact(&exact);
    }
    CHECK(done > 3 * (int)end / 4);
}

/* A linear field whose values are rounded: what a contraction is off by is largest at its result. */
static void test_the_result_counts(void)
{
    struct exact_world exact;
    int done = 0;
    REQUIRE(open_exact(&exact, "cube", 4, 3));
    struct working *working = &exact.world.working;
    struct working_field *field = &working->fields[0];
    double least = INFINITY, greatest = -INFINITY;
    for (uint32_t slot = 0; slot < working->slot_count; slot++) {
        const double *p = working_row(working, slot);
        double value = p[0] + 2 * p[1] - p[2];
        exact.mesh.fields[0].values[working->node[slot]] = *working_values(working, slot, 0) = value;
        least = smaller(least, value);
        greatest = larger(greatest, value);
    }
    field->middles[0] = 0;
    field->component_range[0][0] = least;
    field->component_range[0][1] = greatest;
    working->components[0].scale = working->components[0].factor = 1 / (greatest - least);
    field->grid = (struct grid){8, least, 0.25, 255};
    for (int tries = 0; tries < 5000; tries++) {
        if (!pick(&exact))
            continue;
        struct finding finding = examine(&exact, 10);
        double there = fabs(exact.examiner.chosen[0] -
                            (exact.join.p[0] + 2 * exact.join.p[1] - exact.join.p[2])) * working->components[0].scale;
        CHECK(finding.allowed && there <= finding.error * (1 + 1e-9) + 1e-12);
        done += there > 1e-3;
    }
    CHECK(done > 200);
    close_exact(&exact);
}

/* Does the boundary allow the position as one that is none of its vertices? */
static bool keeps_boundary(const struct exact_world *exact)
{
    static const double still[4] = {0};
    return border_allows(&exact->world.run.border, &exact->world.working, exact->join.simplex, exact->join.count,
                         still, exact->join.p);
}

/* As many contractions within a limit as there are in so many tries, far beyond what the envelope would allow: the
 * overlay holds it. A part of them makes flat cones, whose walls are almost one plane. */
static void check_sequence(const char *name, uint32_t size, uint64_t seed, int tries, bool flat)
{
    struct exact_world exact;
    const double limit = 0.05;
    double envelope = 0;
    int done = 0;
    REQUIRE(open_exact(&exact, name, size, seed));
    for (int i = 0; i < tries; i++) {
        if (!pick(&exact) || (flat && i % 2 && !(flatten(&exact) && keeps_boundary(&exact))))
            continue;
        struct finding finding = examine(&exact, limit);
        CHECK(finding.allowed ? finding.error <= limit * (1 + 1e-9) : finding.error > limit *
              (1 - (flat ? 1e-3 : 1e-6)));
        if (!finding.allowed)
            continue;
        envelope = larger(envelope, envelope_of(&exact));
        contract(&exact);
        done++;
        if (done % 8 == 0)
            renumber(&exact);
        CHECK(!(flat && i % 2) || overlay_error(&exact) <= limit * (1 + 1e-6));
    }
    double truth = overlay_error(&exact);
    printf("# %s %u: %d contractions, overlay %g, envelope %g\n", name, size, done, truth, envelope);
    CHECK(done > 20 && envelope > 2 * limit);
    CHECK(truth <= limit * (1 + 1e-6) && truth > 0.8 * limit);
    close_exact(&exact);
}

static void test_sequences(void)
{
    check_sequence("cube", SANITIZED ? 5 : 6, 77, 30000, false);
    check_sequence("torus", 4, 77, 30000, false);
    check_sequence("fin", 5, 77, 30000, false);
    check_sequence("delta", 2, 77, 30000, false);
    for (uint64_t seed = 1; seed < (SANITIZED ? 4 : 31); seed++)
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
