/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The complex while it is contracted: after every contraction its neighbours and stars are those of a rebuild, and its
 * topology is the original's; the link condition against its definition.
 */
#include "src/simplify/complex.h"

#include <stdlib.h>

#include "src/mesh/adjacency.h"
#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/test.h"

/* ---- against a rebuild */

/* The living tetrahedra, numbered anew; *numbers [tet] their new numbers. */
static uint32_t living(const struct complex *complex, uint32_t *corners, uint32_t *numbers)
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < complex->tet_count; t++) {
        numbers[t] = TETLOD_NONE;
        if (complex->corners[4 * t] == TETLOD_NONE)
            continue;
        memcpy(corners + 4 * count, complex->corners + 4 * t, 4 * sizeof *corners);
        numbers[t] = count++;
    }
    return count;
}

static unsigned wrong_neighbours(const struct complex *complex, const uint32_t *numbers, const uint32_t *neighbours)
{
    unsigned wrong = 0;
    for (uint32_t t = 0; t < complex->tet_count; t++)
        for (unsigned f = 0; f < 4 && numbers[t] != TETLOD_NONE; f++) {
            uint32_t got = complex->neighbours[4 * t + f];
            got = got == TETLOD_NONE ? got : 4 * numbers[got / 4] + got % 4;
            wrong += got != neighbours[4 * numbers[t] + f];
        }
    return wrong;
}

static unsigned wrong_stars(const struct complex *complex, const uint32_t *numbers, const size_t *offsets,
                            const uint32_t *stars)
{
    unsigned wrong = 0;
    for (uint32_t v = 0; v < complex->vertex_count; v++) {
        const uint32_t *star = complex->pool + complex->star_begin[v];
        if (!complex_alive(complex, v)) {
            wrong += offsets[v + 1] != offsets[v];
            continue;
        }
        wrong += complex->star_count[v] != offsets[v + 1] - offsets[v];
        for (uint32_t i = 0; i < complex->star_count[v]; i++) {
            unsigned found = 0;
            for (size_t j = offsets[v]; j < offsets[v + 1]; j++)
                found += stars[j] == numbers[star[i]];
            wrong += found != 1;
        }
    }
    return wrong;
}

static unsigned wrong_flags(const struct complex *complex)
{
    unsigned wrong = 0;
    for (uint32_t v = 0; v < complex->vertex_count; v++) {
        const uint32_t *star = complex->pool + complex->star_begin[v];
        bool boundary = false;
        for (uint32_t i = 0; complex_alive(complex, v) && i < complex->star_count[v]; i++)
            for (unsigned f = 0; f < 4; f++)
                boundary |= complex->corners[4 * star[i] + f] != v && complex_boundary_face(complex, star[i], f);
        wrong += complex_alive(complex, v) && boundary != !!(complex->flags[v] & VERTEX_BOUNDARY);
    }
    return wrong;
}

/* Compares with a rebuild, and the topology with that of the start. False: something is wrong. */
static bool check_complex(const struct complex *complex, const struct mesh_report *start)
{
    size_t m = complex->tet_count, n = complex->vertex_count;
    uint32_t *corners = malloc(4 * m * sizeof *corners), *numbers = malloc(m * sizeof *numbers);
    uint32_t *neighbours = malloc(4 * m * sizeof *neighbours), *stars = malloc(4 * m * sizeof *stars);
    size_t *offsets = malloc((n + 1) * sizeof *offsets);
    int failures = test_failed_here;
    struct mesh_report now;
    if (corners && numbers && neighbours && stars && offsets) {
        uint32_t count = living(complex, corners, numbers), overfull;
        CHECK_INT(count, complex->tets_alive);
        CHECK_INT(adjacency_build(corners, count, (uint32_t)n, neighbours, &overfull, NULL), TETLOD_OK);
        stars_build(corners, count, (uint32_t)n, offsets, stars);
        CHECK_INT(wrong_neighbours(complex, numbers, neighbours), 0);
        CHECK_INT(wrong_stars(complex, numbers, offsets, stars), 0);
        CHECK_INT(wrong_flags(complex), 0);
        CHECK_INT(mesh_check(complex->positions, corners, (uint32_t)n, count, &now, NULL), TETLOD_OK);
        CHECK_INT(n - now.unused_vertices, complex->vertices_alive - start->unused_vertices);
        CHECK_INT(now.overfull_faces, 0);
        CHECK_INT(now.duplicate_tets, 0);
        CHECK_INT(now.euler, start->euler);
        CHECK_INT(now.components, start->components);
        CHECK_INT(now.singular_vertices, start->singular_vertices);
        CHECK_INT(now.boundary_components, start->boundary_components);
        CHECK_INT(now.boundary_singular_edges, start->boundary_singular_edges);
    } else
        TEST_FAIL("out of memory");
    free(corners);
    free(numbers);
    free(neighbours);
    free(stars);
    free(offsets);
    return test_failed_here == failures;
}

/* A random simplex of two to four vertices of a random living tetrahedron that can be contracted; 0: not this time. */
static uint32_t pick_simplex(const struct complex *complex, uint64_t *random, uint32_t simplex[4])
{
    uint32_t t = (uint32_t)(gen_random(random) % complex->tet_count), count = 2 + (uint32_t)(gen_random(random) % 5) / 2;
    unsigned first = (unsigned)(gen_random(random) % 4);
    count = count > 4 ? 4 : count;
    if (complex->corners[4 * t] == TETLOD_NONE)
        return 0;
    for (uint32_t s = 0; s < count; s++) {
        simplex[s] = complex->corners[4 * t + (first + s) % 4];
        if (complex->flags[simplex[s]] & (VERTEX_FROZEN | VERTEX_SINGULAR))
            return 0;
    }
    return count;
}

/* Contracts at random whatever the link condition allows, wherever that leads the geometry. */
static void contract_at_random(const struct tetmesh *mesh, uint64_t seed, uint32_t least)
{
    struct complex complex;
    struct star star = {0};
    struct mesh_report start;
    uint32_t simplex[4], count, contracted = 0;
    REQUIRE(mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, &start, NULL) == TETLOD_OK);
    REQUIRE(complex_init(&complex, mesh, NULL) == TETLOD_OK);
    bool well = check_complex(&complex, &start);
    for (uint32_t tries = 0; well && tries < 40 * mesh->tet_count; tries++) {
        bool holds;
        if (!(count = pick_simplex(&complex, &seed, simplex)))
            continue;
        CHECK_INT(star_gather(&star, &complex, simplex, count, NULL), TETLOD_OK);
        CHECK_INT(star_link_condition(&star, &complex, &holds, NULL), TETLOD_OK);
        if (!holds)
            continue;
        double p[3];
        memcpy(p, complex.positions + 3 * simplex[count - 1], sizeof p);
        uint32_t node = complex.node[simplex[1]], alive = complex.tets_alive;
        CHECK_INT(complex_contract(&complex, &star, p, NULL), TETLOD_OK);
        CHECK_INT(complex.log.children[4 * contracted + 1], node);
        CHECK_INT(complex.node[simplex[0]], mesh->vertex_count + contracted);
        CHECK_INT(alive - complex.tets_alive, star.removed_count);
        contracted++;
        well = check_complex(&complex, &start);
        if (!well)
            printf("# after contraction %u of %u vertices\n", contracted, count);
    }
    if (contracted < least)
        TEST_FAIL("%u contractions, not %u at least", contracted, least);
    star_fini(&star);
    complex_fini(&complex);
}

static void test_random_contractions_of_samples(void)
{
    static const struct {
        const char *name;
        uint32_t size, least;
    } meshes[] = {{"cube", 3, 30}, {"torus", 1, 10}, {"torus", 2, 50}, {"shell", 2, 20}, {"delta", 2, 50}, {"fin", 4, 50}};
    for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
        struct tetmesh mesh = {0};
        REQUIRE(sample_find(meshes[i].name)->make(&mesh, meshes[i].size, NULL) == TETLOD_OK);
        printf("# %s %u\n", meshes[i].name, meshes[i].size);
        for (uint64_t seed = 1; seed < (mesh.tet_count < 1000 ? 4 : 2); seed++)
            contract_at_random(&mesh, seed, meshes[i].least);
        tetmesh_fini(&mesh);
    }
}

/* The mesh of a generated sequence, borrowed. */
static struct tetmesh borrow(const struct recode *recode)
{
    struct tetmesh mesh = {.vertex_count = recode->input.vertices, .tet_count = recode->input.tets};
    mesh.position_type = recode->input.position_type;
    mesh.positions = (double *)(uintptr_t)recode->input.positions;
    mesh.corners = (uint32_t *)(uintptr_t)recode->input.corners;
    return mesh;
}

static void test_random_contractions_with_holes(void)
{
    for (uint64_t seed = 1; seed < 12; seed++) {
        struct recode recode;
        struct gen_options options = {.kind = GEN_HOLES, .seed = seed, .size = 4, .levels = 2, .arity = 2};
        REQUIRE(gen_make(&recode, &options));
        struct tetmesh mesh = borrow(&recode);
        contract_at_random(&mesh, seed, 1);
        gen_free(&recode);
    }
}

/* ---- the link condition */

struct coned {
    uint32_t count;
    uint32_t (*tets)[4];
};

static struct coned cone(const struct complex *complex)
{
    struct coned coned = {0, malloc(5 * (size_t)complex->tet_count * sizeof *coned.tets)};
    for (uint32_t t = 0; t < complex->tet_count && coned.tets; t++)
        for (unsigned f = 0; f < 5; f++) {
            if (f < 4 && !complex_boundary_face(complex, t, f))
                continue;
            memcpy(coned.tets[coned.count], complex->corners + 4 * t, sizeof *coned.tets);
            if (f < 4)
                coned.tets[coned.count][f] = complex->vertex_count; // the apex
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

/* Every edge; *out_allowed counts those that may be contracted. */
static void check_all_edges(const struct tetmesh *mesh, uint32_t *out_allowed, uint32_t *out_refused)
{
    struct complex complex;
    struct star star = {0};
    unsigned wrong = 0;
    REQUIRE(complex_init(&complex, mesh, NULL) == TETLOD_OK);
    struct coned coned = cone(&complex);
    REQUIRE(coned.tets);
    *out_allowed = *out_refused = 0;
    for (uint32_t t = 0; t < mesh->tet_count; t++)
        for (int e = 0; e < 6; e++) {
            uint32_t edge[2] = {mesh->corners[4 * t + tet_edges[e][0]], mesh->corners[4 * t + tet_edges[e][1]]};
            bool holds;
            CHECK_INT(star_gather(&star, &complex, edge, 2, NULL), TETLOD_OK);
            CHECK_INT(star_link_condition(&star, &complex, &holds, NULL), TETLOD_OK);
            wrong += holds != link_condition(&coned, edge[0], edge[1]);
            *(holds ? out_allowed : out_refused) += 1;
        }
    CHECK_INT(wrong, 0);
    free(coned.tets);
    star_fini(&star);
    complex_fini(&complex);
}

static void test_link_condition_by_definition(void)
{
    uint32_t allowed, refused;
    struct tetmesh mesh = {0};
    static const struct {
        const char *name;
        uint32_t size;
    } meshes[] = {{"cube", 3}, {"torus", 1}, {"shell", 2}, {"delta", 1}};
    for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
        REQUIRE(sample_find(meshes[i].name)->make(&mesh, meshes[i].size, NULL) == TETLOD_OK);
        check_all_edges(&mesh, &allowed, &refused);
        CHECK(allowed > 0 && refused > 0);
        tetmesh_fini(&mesh);
    }
    for (uint64_t seed = 1; seed < 8; seed++) {
        struct recode recode;
        struct gen_options options = {.kind = GEN_HOLES, .seed = seed, .size = 3, .levels = 2, .arity = 2};
        REQUIRE(gen_make(&recode, &options));
        mesh = borrow(&recode);
        check_all_edges(&mesh, &allowed, &refused);
        CHECK(refused > 0);
        gen_free(&recode);
    }
}

/* Whether the condition holds for a simplex of a small complex. */
static bool allows(const double *positions, uint32_t vertices, const uint32_t *corners, uint32_t tets,
                   const uint32_t *simplex, uint32_t count)
{
    struct tetmesh mesh = {.vertex_count = vertices, .tet_count = tets};
    mesh.positions = (double *)(uintptr_t)positions;
    mesh.corners = (uint32_t *)(uintptr_t)corners;
    struct complex complex;
    struct star star = {0};
    bool holds = false;
    CHECK_INT(complex_init(&complex, &mesh, NULL), TETLOD_OK);
    CHECK_INT(star_gather(&star, &complex, simplex, count, NULL), TETLOD_OK);
    CHECK_INT(star_link_condition(&star, &complex, &holds, NULL), TETLOD_OK);
    star_fini(&star);
    complex_fini(&complex);
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

/* ---- what is frozen, and geometry */

static void test_frozen(void)
{
    struct complex complex;
    /* two that share an edge only: both its ends pinch; a third, degenerate one beside */
    double p[] = {0, 0, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, -1, 0, 0, -1, -1, 0, 5, 0, 0, 6, 0, 0, 5, 1, 0, 6, 1, 0};
    uint32_t corners[] = {0, 2, 3, 1, 0, 4, 5, 1, 6, 7, 8, 9};
    struct tetmesh mesh = {.vertex_count = 10, .tet_count = 3, .positions = p, .corners = corners};
    REQUIRE(complex_init(&complex, &mesh, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < 10; v++)
        CHECK_INT(!!(complex.flags[v] & (VERTEX_FROZEN | VERTEX_SINGULAR)), v < 2 || v > 5);
    CHECK_INT(complex.log.degenerate_tets, 1);
    CHECK_INT(complex.log.inverted_tets, 0);
    complex_fini(&complex);
}

static void test_fits(void)
{
    for (int reversed = 0; reversed < 2; reversed++) {
        uint32_t corners[8] = {0, 1, 2, 3, 1, 2, 3, 4};
        if (reversed)
            for (int t = 0; t < 2; t++) {
                corners[4 * t] = t ? 2 : 1;
                corners[4 * t + 1] = t ? 1 : 0;
            }
        struct tetmesh mesh = {.vertex_count = 5, .tet_count = 2, .corners = corners};
        mesh.positions = (double *)(uintptr_t)five;
        struct complex complex;
        struct star star = {0};
        REQUIRE(complex_init(&complex, &mesh, NULL) == TETLOD_OK);
        CHECK_INT(complex.orientation, reversed ? -1 : 1);
        CHECK_INT(complex.log.inverted_tets, 0);
        CHECK_INT(star_gather(&star, &complex, (uint32_t[]){0, 1}, 2, NULL), TETLOD_OK);
        CHECK_INT(star.tet_count, 2);
        CHECK_INT(star.removed_count, 1);
        CHECK(star_fits(&star, &complex, (double[]){0, 0, 0}));
        CHECK(star_fits(&star, &complex, (double[]){0.5, 0, 0}));
        CHECK(!star_fits(&star, &complex, (double[]){1, 1, 1}));        // flat
        CHECK(!star_fits(&star, &complex, (double[]){-1, 1, 1}));        // turned inside out
        CHECK(!star_fits(&star, &complex, (double[]){0.5, 0.75, 0.75 - 1e-12})); // beside the plane of 2 3 4, not enough
        star_fini(&star);
        complex_fini(&complex);
    }
}

int main(void)
{
    RUN(test_random_contractions_of_samples);
    RUN(test_random_contractions_with_holes);
    RUN(test_link_condition_by_definition);
    RUN(test_a_tetrahedron_alone);
    RUN(test_two_tetrahedra);
    RUN(test_through_the_inside);
    RUN(test_a_triangle_without_a_face);
    RUN(test_frozen);
    RUN(test_fits);
    return test_end();
}
