/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The link condition, of edges and of simplices of any size, against its definition; and it is asked of every boundary:
 * a cavity stays.
 */
#include "src/simplify/mesh/links.h"

#include <stdlib.h>

#include "src/log/coarsening.h"
#include "src/measure/measure.h"
#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "src/simplify/rounds/rounds.h"
#include "src/util/array.h"
#include "tests/gen.h"
#include "tests/test.h"
#include "tests/world.h"

/* ---- the definition */

/* The mesh with its boundary coned to one more vertex. */
struct coned {
    uint32_t count;
    uint32_t (*tets)[4];
};

static struct coned cone(const struct working *working)
{
    struct coned coned = {0, malloc((5 * (size_t)working->tet_count + 1) * sizeof *coned.tets)};
    for (uint32_t t = 0; t < working->tet_count && coned.tets; t++)
        for (unsigned f = 0; f < 5; f++) {
            if (f < 4 && !(working->boundary_faces[t] >> f & 1))
                continue;
            memcpy(coned.tets[coned.count], working->corners[t], sizeof *coned.tets);
            if (f < 4)
                coned.tets[coned.count][f] = working->slot_count; // the apex
            coned.count++;
        }
    return coned;
}

static bool has(const uint32_t tet[4], uint32_t v)
{
    return tet[0] == v || tet[1] == v || tet[2] == v || tet[3] == v;
}

/* Is a simplex of both links, together with a and b, a simplex of the complex? */
static bool in_edge_link(const struct coned *coned, uint32_t a, uint32_t b, const uint32_t *common, int count)
{
    for (uint32_t i = 0; i < coned->count; i++) {
        bool all = has(coned->tets[i], a) && has(coned->tets[i], b);
        for (int k = 0; k < count; k++)
            all &= has(coned->tets[i], common[k]);
        if (all)
            return true;
    }
    return false;
}

/* Lk(a) and Lk(b) meet in Lk(ab), by the definition: every simplex that a tetrahedron at a and one at b share. */
static bool link_condition(const struct coned *coned, uint32_t a, uint32_t b)
{
    for (uint32_t i = 0; i < coned->count; i++)
        for (uint32_t j = 0; j < coned->count && has(coned->tets[i], a); j++) {
            uint32_t common[4];
            int count = 0;
            if (!has(coned->tets[j], b))
                continue;
            for (int c = 0; c < 4; c++) {
                uint32_t v = coned->tets[i][c];
                if (v != a && v != b && has(coned->tets[j], v))
                    common[count++] = v;
            }
            if (count && !in_edge_link(coned, a, b, common, count))
                return false;
        }
    return true;
}

/* Every edge of vertices that may be contracted, by both ways; io_counts: edges for which it does not hold, and
 * does. */
static void compare(struct tetmesh *mesh, uint32_t io_counts[2])
{
    struct world world;
    uint32_t wrong = 0;
    REQUIRE(world_open_plain(&world, mesh));
    struct working *working = &world.working;
    struct star_data *data = &world.worker.data;
    struct coned coned = cone(working);
    REQUIRE(coned.tets);
    for (uint32_t v = 0; v < working->slot_count; v++) {
        if (working->stars[v].count == 0 || working->flags[v] & VERTEX_SINGULAR)
            continue;
        REQUIRE(star_data_gather(data, working, v));
        for (uint32_t n = 0; n < data->count; n++) {
            const uint32_t edge[2] = {v, data->slots[n]};
            bool room[2];
            if (working->flags[edge[1]] & VERTEX_SINGULAR)
                continue;
            bool holds = link_condition(&coned, edge[0], edge[1]);
            REQUIRE(star_gather(&world.star, working, edge, 2));
            wrong += links_hold_star(&world.worker.links, &world.star, working, &room[1]) != holds || !room[1];
            wrong += links_hold(&world.worker.links, data, working, n, &room[0]) != holds || !room[0];
            io_counts[holds]++;
        }
    }
    CHECK_INT(wrong, 0);
    free(coned.tets);
    world_close(&world);
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

static void test_by_definition(void)
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

/* Takes a tetrahedron out of the inside of a cube, after one of its corners was moved almost into the face opposite:
 * the cavity is so flat that closing it moves the boundary by little, and in its plane. False: then others would turn
 * over. */
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
        mesh->positions[3 * (size_t)corners[moved] +
                        d] = foot + 0.05 * (mesh->positions[3 * (size_t)corners[moved] + d] - foot);
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
    REQUIRE(coarsening_advance(&coarsening, log, log->count, 1, NULL) == TETLOD_OK);
    for (size_t t = 0; t < coarsening.stored; t++)
        if (coarsening.states[t] < COARSE_DIED)
            memcpy(corners + 4 * (size_t)left++, coarsening.corners + 4 * t, 4 * sizeof *corners);
    REQUIRE(mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, &before,
                       NULL) == TETLOD_OK);
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
            const struct simplify_options options = {.metric = METRIC_ENVELOPE,
                                                     .contract = CONTRACT_EDGES,
                                                     .max_error = 1,
                                                     .min_tets = 1,
                                                     .boundary_angle = 180,
                                                     .boundary_limit = mesh_diagonal(&mesh),
                                                     .growth = 1.2,
                                                     .threads = 1};
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

/* ---- small complexes */

/* Whether the condition holds for a simplex of a small mesh. */
static bool allows(const double *positions, uint32_t vertices, const uint32_t *corners, uint32_t tets,
                   const uint32_t *simplex, uint32_t count)
{
    struct tetmesh mesh = {.vertex_count = vertices, .tet_count = tets};
    mesh.positions = (double *)(uintptr_t)positions;
    mesh.corners = (uint32_t *)(uintptr_t)corners;
    struct world world;
    uint32_t slots[4];
    bool holds = false, room = false;
    CHECK(world_open_plain(&world, &mesh));
    for (uint32_t s = 0; s < count; s++)
        slots[s] = world_slot(&world, simplex[s]);
    CHECK(star_gather(&world.star, &world.working, slots, count));
    holds = links_hold_star(&world.worker.links, &world.star, &world.working, &room);
    CHECK(room);
    world_close(&world);
    return holds;
}

static const double five[5 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};

static void test_a_tetrahedron_alone(void)
{
    const uint32_t corners[4] = {0, 1, 2, 3};
    for (uint32_t a = 0; a < 4; a++) {
        uint32_t simplex[4] = {a, (a + 1) % 4, (a + 2) % 4, (a + 3) % 4};
        for (uint32_t count = 2; count <= 4; count++)
            CHECK(!allows(five, 4, corners, 1, simplex, count));
    }
}

/* Two that share a face: an edge of the shared face would take both away; one to an apex would leave one. */
static void test_two_tetrahedra(void)
{
    const uint32_t corners[8] = {0, 1, 2, 3, 1, 2, 3, 4};
    CHECK(!allows(five, 5, corners, 2, (uint32_t[]){1, 2}, 2));
    CHECK(!allows(five, 5, corners, 2, (uint32_t[]){1, 2, 3}, 3));
    CHECK(allows(five, 5, corners, 2, (uint32_t[]){0, 1}, 2));
    CHECK(allows(five, 5, corners, 2, (uint32_t[]){4, 3}, 2));
    CHECK(!allows(five, 5, corners, 2, (uint32_t[]){0, 1, 2, 3}, 4));
}

/* The diagonal of a cube of six joins boundary to boundary through the inside: contracted, it would pinch the cube. */
static void test_through_the_inside(void)
{
    struct tetmesh mesh = {0};
    uint32_t diagonal[2] = {TETLOD_NONE, TETLOD_NONE};
    REQUIRE(sample_find("cube")->make(&mesh, 1, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        unsigned tets = 0;
        for (uint32_t t = 0; t < mesh.tet_count; t++)
            tets += has(mesh.corners + 4 * t, v);
        if (tets == mesh.tet_count)
            diagonal[diagonal[0] != TETLOD_NONE] = v;
    }
    REQUIRE(diagonal[1] != TETLOD_NONE);
    CHECK(!allows(mesh.positions, mesh.vertex_count, mesh.corners, mesh.tet_count, diagonal, 2));
    tetmesh_fini(&mesh);
}

/* Three tetrahedra around an edge that they close: three vertices of the ring have all edges, but not the face. */
static void test_a_triangle_without_a_face(void)
{
    /* 0-1 is the axis, 2 3 4 the ring around it: contracting 2 and 3 would fold 0 2 4 onto 0 3 4 inside */
    const double p[] = {0, 0, -1, 0, 0, 1, 1, 0, 0, -0.5, 0.9, 0, -0.5, -0.9, 0};
    const uint32_t corners[] = {0, 2, 3, 1, 0, 3, 4, 1, 0, 4, 2, 1};
    CHECK(!allows(p, 5, corners, 3, (uint32_t[]){2, 3}, 2));
    CHECK(!allows(p, 5, corners, 3, (uint32_t[]){0, 1}, 2));
}

int main(void)
{
    RUN(test_by_definition);
    RUN(test_a_tetrahedron_alone);
    RUN(test_two_tetrahedra);
    RUN(test_through_the_inside);
    RUN(test_a_triangle_without_a_face);
    RUN(test_cavities_stay);
    return test_end();
}
