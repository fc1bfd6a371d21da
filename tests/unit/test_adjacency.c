/* SPDX-License-Identifier: BSD-3-Clause */
/* Neighbours and stars against their definitions, by brute force. */
#include "src/mesh/adjacency.h"

#include <stdlib.h>

#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/test.h"

static int has_corner(const uint32_t *tet, uint32_t vertex)
{
    return tet[0] == vertex || tet[1] == vertex || tet[2] == vertex || tet[3] == vertex;
}

/* How many tetrahedra have face f of t; *other is the last one that is not t. */
static unsigned face_tets(const uint32_t *corners, uint32_t tets, uint32_t t, unsigned f, uint32_t *other)
{
    unsigned found = 0;
    for (uint32_t u = 0; u < tets; u++) {
        int all = 1;
        for (unsigned c = 0; c < 4; c++)
            all &= c == f || has_corner(corners + 4 * u, corners[4 * t + c]);
        found += (unsigned)all;
        if (all && u != t)
            *other = u;
    }
    return found;
}

static void check_neighbours(const uint32_t *corners, uint32_t tets, uint32_t vertices, unsigned wanted_overfull)
{
    uint32_t *neighbours = malloc(4 * tets * sizeof *neighbours), overfull = 99;
    unsigned wrong = 0;
    REQUIRE(neighbours);
    CHECK_INT(adjacency_build(corners, tets, vertices, neighbours, &overfull, NULL), TETLOD_OK);
    for (uint32_t t = 0; t < tets; t++)
        for (unsigned f = 0; f < 4; f++) {
            uint32_t other = TETLOD_NONE, got = neighbours[4 * t + f];
            if (face_tets(corners, tets, t, f, &other) != 2) {
                wrong += got != TETLOD_NONE;
                continue;
            }
            wrong += got / 4 != other || neighbours[got] != 4 * t + f ||
                     has_corner(corners + 4 * t, corners[got]); // the corner opposite the face is not on it
        }
    CHECK_INT(wrong, 0);
    CHECK_INT(overfull, wanted_overfull);
    free(neighbours);
}

static void check_stars(const uint32_t *corners, uint32_t tets, uint32_t vertices)
{
    size_t *offsets = malloc((vertices + 1) * sizeof *offsets);
    uint32_t *stars = malloc(4 * tets * sizeof *stars);
    unsigned wrong = 0;
    REQUIRE(offsets && stars);
    stars_build(corners, tets, vertices, offsets, stars);
    for (uint32_t v = 0; v < vertices; v++) {
        size_t at = offsets[v];
        for (uint32_t t = 0; t < tets; t++)
            if (has_corner(corners + 4 * t, v))
                wrong += at >= offsets[v + 1] || stars[at++] != t;
        wrong += at != offsets[v + 1];
    }
    CHECK_INT(wrong, 0);
    free(offsets);
    free(stars);
}

static void test_samples(void)
{
    static const char *const names[] = {"cube", "torus", "shell"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        struct tetmesh mesh = {0};
        const struct sample *sample = sample_find(names[i]);
        REQUIRE(sample && sample->make(&mesh, sample->least_size > 3 ? sample->least_size : 3, NULL) == TETLOD_OK);
        check_neighbours(mesh.corners, mesh.tet_count, mesh.vertex_count, 0);
        check_stars(mesh.corners, mesh.tet_count, mesh.vertex_count);
        tetmesh_fini(&mesh);
    }
}

/* Tetrahedra missing at random: boundaries and vertices that touch, but no face of three. */
static void test_holes(void)
{
    for (uint64_t seed = 1; seed < 6; seed++) {
        struct recode recode;
        struct gen_options options = {.kind = GEN_HOLES, .seed = seed, .size = 3, .levels = 2, .arity = 2};
        REQUIRE(gen_make(&recode, &options));
        check_neighbours(recode.input.corners, recode.input.tets, recode.input.vertices, 0);
        check_stars(recode.input.corners, recode.input.tets, recode.input.vertices);
        gen_free(&recode);
    }
}

static void test_faces_of_three(void)
{
    const uint32_t corners[] = {0, 1, 2, 3, 0, 2, 1, 4, 1, 0, 2, 5, 0, 1, 3, 6};
    check_neighbours(corners, 4, 7, 1);
    check_stars(corners, 4, 7);
}

static void test_too_many(void)
{
    uint32_t none[4] = {0};
    struct tetlod_error error = {0};
    CHECK_INT(adjacency_build(none, ADJACENCY_MAX_TETS + 1u, 4, none, NULL, &error), TETLOD_ERR_LIMIT);
    CHECK(error.message[0]);
}

int main(void)
{
    RUN(test_samples);
    RUN(test_holes);
    RUN(test_faces_of_three);
    RUN(test_too_many);
    return test_end();
}
