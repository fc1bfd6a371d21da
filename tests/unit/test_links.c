/* SPDX-License-Identifier: BSD-3-Clause */
/* The link condition of the rounds: what star_link_condition says of the same edges, which is held against the definition; and it is
 * asked where nothing else would keep the topology. */
#include "src/simplify/links.h"

#include <stdlib.h>

#include "src/log/coarsening.h"
#include "src/measure/measure.h"
#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "src/simplify/border.h"
#include "src/simplify/rounds.h"
#include "src/util/array.h"
#include "tests/gen.h"
#include "tests/test.h"

/* Every edge of vertices that may be contracted; io_counts: edges for which it does not hold, and does. */
static void compare(struct tetmesh *mesh, uint32_t io_counts[2])
{
    struct contraction_log log;
    struct working working;
    struct complex complex;
    struct star star = {0};
    struct hood hood = {0};
    struct links links = {0};
    struct crew *crew = crew_new(1);
    uint32_t controlled = 0, wrong = 0;
    REQUIRE(crew && log_init(&log, mesh, NULL) == TETLOD_OK && complex_init(&complex, mesh, NULL) == TETLOD_OK);
    REQUIRE(working_init(&working, mesh, NULL, &controlled, 1, NULL, &log, NULL) == TETLOD_OK);
    REQUIRE(border_find(&working, crew, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < working.slot_count; v++) {
        if (working.stars[v].count == 0 || working.flags[v] & VERTEX_SINGULAR)
            continue;
        REQUIRE(hood_gather(&hood, &working, v));
        for (uint32_t n = 0; n < hood.count; n++) {
            const uint32_t edge[2] = {working.node[v], working.node[hood.slots[n]]};
            bool holds, room;
            if (working.flags[hood.slots[n]] & VERTEX_SINGULAR)
                continue;
            CHECK_INT(star_gather(&star, &complex, edge, 2, NULL), TETLOD_OK);
            CHECK_INT(star_link_condition(&star, &complex, &holds, NULL), TETLOD_OK);
            wrong += links_hold(&links, &hood, &working, n, &room) != holds || !room;
            io_counts[holds]++;
        }
    }
    CHECK_INT(wrong, 0);
    links_fini(&links);
    hood_fini(&hood);
    star_fini(&star);
    complex_fini(&complex);
    working_fini(&working);
    log_fini(&log);
    crew_free(crew);
}

/* A cube without some of its tetrahedra. */
static void carve(struct tetmesh *mesh, uint32_t size, uint64_t seed, uint32_t one_in)
{
    uint32_t kept = 0;
    REQUIRE(sample_find("cube")->make(mesh, size, NULL) == TETLOD_OK);
    for (size_t t = 0; t < mesh->tet_count; t++)
        if (gen_random(&seed) % one_in)
            memmove(mesh->corners + 4 * (size_t)kept++, mesh->corners + 4 * t, 4 * sizeof *mesh->corners);
    mesh->tet_count = kept;
}

static void test_same_as_the_other(void)
{
    static const char *const names[] = {"cube", "torus", "shell", "delta"};
    uint32_t counts[2] = {0, 0};
    struct tetmesh mesh;
    for (int i = 0; i < 4; i++) {
        REQUIRE(sample_find(names[i])->make(&mesh, 1 + (uint32_t)(i == 0) + (uint32_t)(i == 2), NULL) == TETLOD_OK);
        compare(&mesh, counts);
        tetmesh_fini(&mesh);
    }
    for (uint64_t seed = 0; seed < 60; seed++) {
        carve(&mesh, 2 + (uint32_t)(seed % 3), seed, 2 + (uint32_t)(seed % 13));
        compare(&mesh, counts);
        tetmesh_fini(&mesh);
    }
    printf("# it holds for %u of %u edges\n", counts[1], counts[0] + counts[1]);
    CHECK(counts[0] > 1000 && counts[1] > 1000);
}

static bool all_positive(const struct tetmesh *mesh)
{
    bool positive = true;
    for (size_t t = 0; t < mesh->tet_count && positive; t++) {
        const double *p[4];
        for (size_t c = 0; c < 4; c++)
            p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * t + c];
        positive = tet_volume6(p[0], p[1], p[2], p[3]) > 1e-3;
    }
    return positive;
}

/* Takes a tetrahedron out of the inside of a cube, after one of its corners was moved almost into the face opposite: the cavity is so flat
 * that closing it moves the boundary by little, and in its plane. False: then others would turn over. */
static bool make_cavity(struct tetmesh *mesh, uint64_t *random)
{
    uint32_t t, corners[4];
    bool inside;
    if (sample_find("cube")->make(mesh, 4, NULL) != TETLOD_OK)
        return false;
    mesh->position_type = TETLOD_FLOAT64;
    do {
        t = (uint32_t)(gen_random(random) % mesh->tet_count);
        memcpy(corners, mesh->corners + 4 * (size_t)t, sizeof corners);
        inside = true;
        for (int i = 0; i < 12; i++) {
            double x = mesh->positions[3 * (size_t)corners[i / 3] + (size_t)(i % 3)];
            inside &= x > 0.5 && x < 3.5;
        }
    } while (!inside);
    uint32_t moved = (uint32_t)(gen_random(random) % 4);
    for (size_t d = 0; d < 3; d++) {
        double foot = 0;
        for (size_t c = 0; c < 4; c++)
            foot += c == moved ? 0 : mesh->positions[3 * (size_t)corners[c] + d] / 3;
        mesh->positions[3 * (size_t)corners[moved] + d] = foot + 0.05 * (mesh->positions[3 * (size_t)corners[moved] + d] - foot);
    }
    memcpy(mesh->corners + 4 * (size_t)t, mesh->corners + 4 * (size_t)--mesh->tet_count, sizeof corners);
    return all_positive(mesh);
}

static void check_topology(const struct tetmesh *mesh, const struct contraction_log *log)
{
    struct mesh_report before, after;
    struct coarsening coarsening;
    uint32_t *corners = array_new(mesh->tet_count, 4 * sizeof *corners), left = 0;
    REQUIRE(corners && coarsening_init(&coarsening, mesh, log, NULL) == TETLOD_OK);
    coarsening_advance(&coarsening, log, log->count, 1);
    for (size_t t = 0; t < coarsening.stored; t++)
        if (coarsening.states[t] < COARSE_DIED)
            memcpy(corners + 4 * (size_t)left++, coarsening.corners + 4 * t, 4 * sizeof *corners);
    REQUIRE(mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, &before, NULL) == TETLOD_OK);
    REQUIRE(mesh_check(coarsening.positions, corners, mesh->vertex_count, left, &after, NULL) == TETLOD_OK);
    CHECK_INT(before.boundary_components, 2);
    CHECK_INT(after.boundary_components, 2);
    CHECK_INT(after.euler, before.euler);
    CHECK_INT(after.inverted_tets + after.degenerate_tets, 0);
    coarsening_fini(&coarsening);
    free(corners);
}

static void test_cavities_stay(void)
{
    uint32_t cavities = 0;
    uint64_t random = 1;
    for (int i = 0; i < 40; i++) {
        struct tetmesh mesh;
        struct contraction_log log;
        if (make_cavity(&mesh, &random)) {
            const struct simplify_options options = {.metric = METRIC_ENVELOPE, .contract = CONTRACT_EDGES, .max_error = 1, .min_tets = 1,
                                                     .boundary_angle = 180, .boundary_limit = mesh_diagonal(&mesh), .growth = 1.2, .threads = 1};
            REQUIRE(rounds_simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
            check_topology(&mesh, &log);
            log_fini(&log);
            cavities++;
        }
        tetmesh_fini(&mesh);
    }
    printf("# %u cavities\n", cavities);
    CHECK(cavities > 10);
}

int main(void)
{
    RUN(test_same_as_the_other);
    RUN(test_cavities_stay);
    return test_end();
}
