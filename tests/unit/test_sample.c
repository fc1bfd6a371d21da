/* SPDX-License-Identifier: BSD-3-Clause */
/* What each sample promises: counts, a valid manifold of the right topology, and the same bits everywhere. */
#include <stdlib.h>

#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/test.h"

static uint64_t hash(uint64_t h, const void *bytes, size_t size) // FNV-1a
{
    for (size_t i = 0; i < size; i++)
        h = (h ^ ((const unsigned char *)bytes)[i]) * 0x100000001b3;
    return h;
}

static uint64_t hash_mesh(const struct tetmesh *mesh)
{
    uint64_t h = 0xcbf29ce484222325;
    h = hash(h, mesh->positions, 24 * (size_t)mesh->vertex_count);
    h = hash(h, mesh->corners, 16 * (size_t)mesh->tet_count);
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        h = hash(h, mesh->fields[f].name, strlen(mesh->fields[f].name));
        h = hash(h, mesh->fields[f].values, (size_t)mesh->fields[f].components * mesh->vertex_count * 8);
    }
    return h;
}

struct wanted {
    const char *name;
    uint32_t size, vertices, tets;
    int euler, boundary_euler;
    uint32_t boundary_components;
    uint64_t hash;
};

static bool is_float32(const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if ((double)(float)values[i] != values[i])
            return false;
    return true;
}

static void check_topology(const struct tetmesh *mesh, const struct wanted *wanted)
{
    struct mesh_report r = {0};
    CHECK_INT(mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, &r, NULL), TETLOD_OK);
    CHECK_INT(r.unused_vertices, 0);
    CHECK_INT(r.components, 1);
    CHECK_INT(r.orientation, 1);
    CHECK_INT(r.degenerate_tets, 0);
    CHECK_INT(r.inverted_tets, 0);
    CHECK_INT(r.duplicate_tets, 0);
    CHECK_INT(r.overfull_faces, 0);
    CHECK_INT(r.same_side_faces, 0);
    CHECK_INT(r.singular_vertices, 0);
    CHECK_INT(r.boundary_singular_edges, 0);
    CHECK_INT(r.euler, wanted->euler);
    CHECK_INT(r.boundary_components, wanted->boundary_components);
    CHECK_INT((int64_t)r.boundary_vertices - (int64_t)r.boundary_edges + (int64_t)r.boundary_faces,
              wanted->boundary_euler);
}

static void check_sample(const struct wanted *wanted)
{
    struct tetmesh mesh;
    const struct sample *sample = sample_find(wanted->name);
    REQUIRE(sample != NULL);
    REQUIRE(sample->make(&mesh, wanted->size ? wanted->size : sample->default_size, NULL) == TETLOD_OK);
    CHECK_INT(mesh.vertex_count, wanted->vertices);
    CHECK_INT(mesh.tet_count, wanted->tets);
    CHECK_INT(tetmesh_validate(&mesh, NULL), TETLOD_OK);
    CHECK_INT(mesh.position_type, TETLOD_FLOAT32);
    CHECK(is_float32(mesh.positions, 3 * (size_t)mesh.vertex_count));
    CHECK_INT(mesh.fields[0].components, 1);
    for (uint32_t f = 0; f < mesh.field_count; f++)
        CHECK(is_float32(mesh.fields[f].values, (size_t)mesh.fields[f].components * mesh.vertex_count));
    check_topology(&mesh, wanted);
    if (hash_mesh(&mesh) != wanted->hash)
        TEST_FAIL("%s %u: hash 0x%016llx", wanted->name, wanted->size, (unsigned long long)hash_mesh(&mesh));
    tetmesh_fini(&mesh);
}

static const struct wanted ball_like[] = {
    {"cube", 1, 8, 6, 1, 2, 1, 0x459b498992ae068d},
    {"cube", 20, 9261, 48000, 1, 2, 1, 0x70cf35e7be7ced39},
    {"fin", 0, 9025, 38880, 1, 2, 1, 0xe663ccc53e7cd8a6},
    {"fin", 5, 96, 225, 1, 2, 1, 0x6f5b68d0df8a12bc},
    {"delta", 0, 8598, 43416, 1, 2, 1, 0x1e9345211a86fcc0},
    {"wake", 4, 135, 320, 1, 2, 1, 0x53dc391609fac07f},
    {"delta", 1, 113, 276, 1, 2, 1, 0xd9d6701618e01abd},
};

static void test_balls(void)
{
    for (size_t i = 0; i < sizeof ball_like / sizeof *ball_like; i++)
        check_sample(&ball_like[i]);
}

static void test_torus_has_a_handle(void)
{
    check_sample(&(struct wanted){"torus", 0, 4050, 19200, 0, 0, 1, 0x41e2bbc2d54bcbe2});
    check_sample(&(struct wanted){"torus", 1, 32, 48, 0, 0, 1, 0xd896e7dae9be70d4});
}

static void test_shell_has_a_cavity(void)
{
    check_sample(&(struct wanted){"shell", 0, 3612, 18000, 2, 4, 2, 0x415aa4175f09d4ea});
    check_sample(&(struct wanted){"shell", 2, 52, 144, 2, 4, 2, 0x8abc296d51b6c5c1});
}

static void test_cube_is_the_thesis_cube(void)
{
    struct tetmesh mesh;
    struct mesh_report r = {0};
    double range[2];
    REQUIRE(sample_find("cube")->make(&mesh, 20, NULL) == TETLOD_OK);
    CHECK_INT(mesh_check(mesh.positions, mesh.corners, mesh.vertex_count, mesh.tet_count, &r, NULL), TETLOD_OK);
    CHECK_NEAR(r.volume, 8000, 1e-6);
    CHECK_NEAR(r.boundary_area, 2400, 1e-9);
    CHECK_INT(r.boundary_vertices, 2402);
    CHECK_INT(r.boundary_faces, 4800);
    point_field_range(&mesh.fields[0], mesh.vertex_count, range);
    CHECK_NEAR(range[1], 8000, 0);
    tetmesh_fini(&mesh);
}

static void test_delta_is_strongly_graded(void)
{
    struct tetmesh mesh;
    double least = INFINITY, largest = 0;
    REQUIRE(sample_find("delta")->make(&mesh, 6, NULL) == TETLOD_OK);
    for (uint32_t t = 0; t < mesh.tet_count; t++) {
        const uint32_t *c = mesh.corners + 4 * (size_t)t;
        const double *p = mesh.positions;
        double size = sqrt(tet_size_squared(p + 3 * c[0], p + 3 * c[1], p + 3 * c[2], p + 3 * c[3]));
        least = fmin(least, size);
        largest = fmax(largest, size);
    }
    CHECK(largest / least > 1e4);
    tetmesh_fini(&mesh);
}

static void test_sizes_that_do_not_fit_fail(void)
{
    struct tetmesh mesh;
    struct tetlod_error error = {0};
    CHECK_INT(sample_find("cube")->make(&mesh, 2000, &error), TETLOD_ERR_LIMIT);
    CHECK(mesh.positions == NULL);
    CHECK(sample_find("sphere") == NULL);
}

int main(void)
{
    RUN(test_balls);
    RUN(test_torus_has_a_handle);
    RUN(test_shell_has_a_cavity);
    RUN(test_cube_is_the_thesis_cube);
    RUN(test_delta_is_strongly_graded);
    RUN(test_sizes_that_do_not_fit_fail);
    return test_end();
}
