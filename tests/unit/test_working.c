/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The working mesh while it is contracted: after every contraction its stars and boundary faces are those of a rebuild,
 * and its topology is the original's; also after its slots and tetrahedra got new numbers.
 */
#include "src/mesh/adjacency.h"
#include "src/mesh/mesh_check.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/test.h"
#include "tests/world.h"

/* ---- against a rebuild */

struct rebuilt {
    uint32_t count, *corners, *numbers, *neighbours, *stars; /* numbers: [tet of the working mesh] */
    size_t *offsets;
    double *positions;
};

static void rebuilt_fini(struct rebuilt *rebuilt)
{
    free(rebuilt->corners);
    free(rebuilt->numbers);
    free(rebuilt->neighbours);
    free(rebuilt->stars);
    free(rebuilt->offsets);
    free(rebuilt->positions);
}

/* The living tetrahedra, numbered anew. */
static bool rebuild(struct rebuilt *out, const struct working *working)
{
    size_t m = working->tet_count, n = working->slot_count;
    uint32_t overfull;
    *out = (struct rebuilt){.corners = malloc(16 * m + 1), .numbers = malloc(4 * m + 1),
                            .neighbours = malloc(16 * m + 1),
                            .stars = malloc(16 * m + 1), .offsets = malloc((n + 1) * sizeof(size_t)),
                            .positions = malloc(24 * n + 1)};
    if (!out->corners || !out->numbers || !out->neighbours || !out->stars || !out->offsets || !out->positions)
        return false;
    for (uint32_t t = 0; t < m; t++) {
        out->numbers[t] = tet_gone(working, t) ? TETLOD_NONE : out->count;
        if (!tet_gone(working, t))
            memcpy(out->corners + 4 * (size_t)out->count++, working->corners[t], 16);
    }
    for (uint32_t v = 0; v < n; v++)
        memcpy(out->positions + 3 * (size_t)v, working_row(working, v), 24);
    stars_build(out->corners, out->count, (uint32_t)n, out->offsets, out->stars);
    return adjacency_build(out->corners, out->count, (uint32_t)n, out->neighbours, &overfull, NULL) == TETLOD_OK;
}

static unsigned wrong_boundary(const struct working *working, const struct rebuilt *rebuilt)
{
    unsigned wrong = 0;
    for (uint32_t t = 0; t < working->tet_count; t++)
        for (unsigned f = 0; f < 4 && !tet_gone(working, t); f++)
            wrong += (working->boundary_faces[t] >> f & 1) !=
                     (rebuilt->neighbours[4 * (size_t)rebuilt->numbers[t] + f] == TETLOD_NONE);
    return wrong;
}

static unsigned wrong_stars(const struct working *working, const struct rebuilt *rebuilt)
{
    unsigned wrong = 0;
    for (uint32_t v = 0; v < working->slot_count; v++) {
        const uint32_t *star = working->pool + working->stars[v].begin;
        uint32_t count = working_alive(working, v) ? working->stars[v].count : 0;
        wrong += count != rebuilt->offsets[v + 1] - rebuilt->offsets[v];
        for (uint32_t i = 0; i < count; i++) {
            unsigned found = 0;
            for (size_t j = rebuilt->offsets[v]; j < rebuilt->offsets[v + 1]; j++)
                found += rebuilt->stars[j] == rebuilt->numbers[star[i]];
            wrong += found != 1;
        }
    }
    return wrong;
}

static unsigned wrong_flags(const struct working *working)
{
    unsigned wrong = 0;
    for (uint32_t v = 0; v < working->slot_count; v++) {
        bool boundary = false;
        for (uint32_t i = 0; working_alive(working, v) && i < working->stars[v].count; i++) {
            uint32_t tet = working->pool[working->stars[v].begin + i];
            for (unsigned f = 0; f < 4; f++)
                boundary |= working->corners[tet][f] != v && working->boundary_faces[tet] >> f & 1;
        }
        wrong += working_alive(working, v) && boundary != !!(working->flags[v] & VERTEX_BOUNDARY);
    }
    return wrong;
}

/* Compares with a rebuild, and the topology with that of the start. False: something is wrong. */
static bool check_working(const struct working *working, const struct mesh_report *start)
{
    int failures = test_failed_here;
    struct rebuilt rebuilt;
    struct mesh_report now;
    if (rebuild(&rebuilt, working)) {
        CHECK_INT(rebuilt.count, working->tets_alive);
        CHECK_INT(wrong_boundary(working, &rebuilt), 0);
        CHECK_INT(wrong_stars(working, &rebuilt), 0);
        CHECK_INT(wrong_flags(working), 0);
        CHECK_INT(mesh_check(rebuilt.positions, rebuilt.corners, working->slot_count, rebuilt.count, &now, NULL),
                  TETLOD_OK);
        CHECK_INT(working->slot_count - now.unused_vertices, working->vertices_alive - start->unused_vertices);
        CHECK_INT(now.overfull_faces, 0);
        CHECK_INT(now.duplicate_tets, 0);
        CHECK_INT(now.euler, start->euler);
        CHECK_INT(now.components, start->components);
        CHECK_INT(now.singular_vertices, start->singular_vertices);
        CHECK_INT(now.boundary_components, start->boundary_components);
        CHECK_INT(now.boundary_singular_edges, start->boundary_singular_edges);
    } else
        TEST_FAIL("out of memory");
    rebuilt_fini(&rebuilt);
    return test_failed_here == failures;
}

/* New numbers: the border's data and the nodes are still those of the same vertices. */
static void renumber(struct world *world)
{
    struct renumbering numbers;
    struct working *working = &world->working;
    uint32_t alive = working->vertices_alive, moved = 0;
    double sum = 0, sum_after = 0;
    for (uint32_t v = 0; v < working->slot_count; v++)
        if (working_alive(working, v)) {
            world->run.border.most[v] = working->node[v];
            sum += working->node[v] * (1 + working_row(working, v)[0]);
        }
    REQUIRE(working_renumber(working, &numbers, NULL) == TETLOD_OK);
    border_renumber(&world->run.border, &numbers);
    renumbering_fini(&numbers);
    for (uint32_t v = 0; v < working->slot_count; v++) {
        moved += world->run.border.most[v] != working->node[v];
        sum_after += working->node[v] * (1 + working_row(working, v)[0]);
    }
    CHECK_INT(working->slot_count, alive);
    CHECK_INT(working->tet_count, working->tets_alive);
    CHECK_INT(moved, 0);
    CHECK_NEAR(sum_after, sum, 1e-9 * fabs(sum));
}

/* Contracts at random whatever the link condition allows, wherever that leads the geometry. */
static void contract_at_random(const struct tetmesh *mesh, uint64_t seed, uint32_t least)
{
    struct world world;
    struct mesh_report start;
    uint32_t simplex[4];
    REQUIRE(mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, &start, NULL) == TETLOD_OK);
    REQUIRE(world_open_plain(&world, mesh));
    bool well = check_working(&world.working, &start);
    for (uint32_t tries = 0; well && tries < 40 * mesh->tet_count; tries++) {
        uint32_t tet = (uint32_t)(gen_random(&seed) % world.working.tet_count),
                 count = 2 + (uint32_t)(gen_random(&seed) % 5) / 2;
        bool room;
        count = count > 4 ? 4 : count;
        if (!world_pick(&world, tet, (uint32_t)(gen_random(&seed) % 4), count, simplex))
            continue;
        REQUIRE(star_gather(&world.star, &world.working, simplex, count));
        if (!links_hold_star(&world.worker.links, &world.star, &world.working, &room))
            continue;
        uint32_t alive = world.working.tets_alive;
        double p[3];
        memcpy(p, working_row(&world.working, simplex[0]), sizeof p);
        REQUIRE(world_contract(&world, p));
        CHECK_INT(alive - world.working.tets_alive, world.star.removed_count);
        well = check_working(&world.working, &start);
        if (world.contracted % 16 == 0) {
            start.unused_vertices = 0; // they are gone with the dead, or alive by themselves
            renumber(&world);
            for (uint32_t v = 0; v < world.working.slot_count; v++)
                start.unused_vertices += world.working.stars[v].count == 0;
        }
        if (!well)
            printf("# after contraction %u, of %u vertices\n", world.contracted, count);
    }
    if (world.contracted < least)
        TEST_FAIL("%u contractions, not %u at least", world.contracted, least);
    world_close(&world);
}

static void test_random_contractions_of_samples(void)
{
    static const struct {
        const char *name;
        uint32_t size, least;
    } meshes[] = {{"cube", 3, 30}, {"torus", 1, 10}, {"torus", 2, 50}, {"shell", 2, 20}, {"delta", 2, 50},
                  {"fin", 4, 50}};
    for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
        struct tetmesh mesh = {0};
        REQUIRE(sample_find(meshes[i].name)->make(&mesh, meshes[i].size, NULL) == TETLOD_OK);
        printf("# %s %u\n", meshes[i].name, meshes[i].size);
        for (uint64_t seed = 1; seed < (mesh.tet_count < 1000 ? 4 : 2); seed++)
            contract_at_random(&mesh, seed, meshes[i].least);
        tetmesh_fini(&mesh);
    }
}

static void test_random_contractions_with_holes(void)
{
    for (uint64_t seed = 1; seed < 12; seed++) {
        struct recode recode;
        struct gen_options options = {.kind = GEN_HOLES, .seed = seed, .size = 4, .levels = 2, .arity = 2};
        REQUIRE(gen_make(&recode, &options));
        struct tetmesh mesh = {.vertex_count = recode.input.vertices, .tet_count = recode.input.tets};
        mesh.position_type = recode.input.position_type;
        mesh.positions = (double *)(uintptr_t)recode.input.positions;
        mesh.corners = (uint32_t *)(uintptr_t)recode.input.corners;
        contract_at_random(&mesh, seed, 1);
        gen_free(&recode);
    }
}

/* ---- what is frozen, and geometry */

static void test_frozen(void)
{
    struct world world;
    /* two that share an edge only: both its ends pinch; a third, degenerate one beside */
    double p[] = {0, 0, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, -1, 0, 0, -1, -1, 0, 5, 0, 0, 6, 0, 0, 5, 1, 0, 6, 1, 0};
    uint32_t corners[] = {0, 2, 3, 1, 0, 4, 5, 1, 6, 7, 8, 9};
    struct tetmesh mesh = {.vertex_count = 10, .tet_count = 3, .positions = p, .corners = corners};
    REQUIRE(world_open_plain(&world, &mesh));
    for (uint32_t v = 0; v < 10; v++)
        CHECK_INT(!!(world.working.flags[world_slot(&world, v)] & (VERTEX_FROZEN | VERTEX_SINGULAR)), v < 2 || v > 5);
    CHECK_INT(world.log.degenerate_tets, 1);
    CHECK_INT(world.log.inverted_tets, 0);
    world_close(&world);
}

static void test_fits(void)
{
    double five[5 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
    for (int reversed = 0; reversed < 2; reversed++) {
        uint32_t corners[8] = {0, 1, 2, 3, 1, 2, 3, 4};
        if (reversed)
            for (int t = 0; t < 2; t++) {
                corners[4 * t] = t ? 2 : 1;
                corners[4 * t + 1] = t ? 1 : 0;
            }
        struct tetmesh mesh = {.vertex_count = 5, .tet_count = 2, .positions = five, .corners = corners};
        struct world world;
        struct star *star = &world.star;
        REQUIRE(world_open_plain(&world, &mesh));
        CHECK_INT(world.log.inverted_tets, 0);
        const uint32_t edge[2] = {world_slot(&world, 0), world_slot(&world, 1)};
        REQUIRE(star_gather(star, &world.working, edge, 2));
        CHECK_INT(star->tet_count, 2);
        CHECK_INT(star->removed_count, 1);
        CHECK(star_fits(star, &world.working, (double[]){0, 0, 0}));
        CHECK(star_fits(star, &world.working, (double[]){0.5, 0, 0}));
        CHECK(!star_fits(star, &world.working, (double[]){1, 1, 1}));                    // flat
        CHECK(!star_fits(star, &world.working, (double[]){-1, 1, 1}));                   // turned inside out
        // beside the plane of 2 3 4, not enough
        CHECK(!star_fits(star, &world.working, (double[]){0.5, 0.75, 0.75 - 1e-12}));
        world_close(&world);
    }
}

int main(void)
{
    RUN(test_random_contractions_of_samples);
    RUN(test_random_contractions_with_holes);
    RUN(test_frozen);
    RUN(test_fits);
    return test_end();
}
