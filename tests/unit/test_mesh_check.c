/* SPDX-License-Identifier: BSD-3-Clause */
/* Small complexes whose defects are known. */
#include "src/mesh/mesh_check.h"
#include "tests/test.h"

static const double unit[5 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};

static struct mesh_report check(const double *positions, uint32_t vertices, const uint32_t *corners, uint32_t tets)
{
    struct mesh_report report = {0};
    CHECK_INT(mesh_check(positions, corners, vertices, tets, &report, NULL), TETLOD_OK);
    return report;
}

static void test_one_tetrahedron(void)
{
    struct mesh_report r = check(unit, 5, (uint32_t[]){0, 1, 2, 3}, 1);
    CHECK_INT(r.unused_vertices, 1);
    CHECK_INT(r.components, 1);
    CHECK_INT(r.orientation, 1);
    CHECK_NEAR(r.volume, 1.0 / 6, 1e-15);
    CHECK_NEAR(r.boundary_area, 1.5 + sqrt(3) / 2, 1e-15);
    CHECK_INT(r.edges, 6);
    CHECK_INT(r.faces, 4);
    CHECK_INT(r.euler, 1);
    CHECK_INT(r.boundary_vertices, 4);
    CHECK_INT(r.boundary_edges, 6);
    CHECK_INT(r.boundary_faces, 4);
    CHECK_INT(r.boundary_components, 1);
    CHECK_INT(r.singular_vertices, 0);
    CHECK_INT(r.boundary_singular_edges, 0);
}

static void test_two_that_share_a_face(void)
{
    struct mesh_report r = check(unit, 5, (uint32_t[]){0, 1, 2, 3, 1, 2, 3, 4}, 2);
    CHECK_INT(r.inverted_tets, 0);
    CHECK_INT(r.same_side_faces, 0);
    CHECK_INT(r.faces, 7);
    CHECK_INT(r.boundary_faces, 6);
    CHECK_INT(r.singular_vertices, 0);
    CHECK_NEAR(r.volume, 1.0 / 6 + 1.0 / 3, 1e-15);
}

/* Two on both sides of a face lie right, whatever turn they are listed in; two on one side do not. */
static void test_numbered_otherwise_and_inverted(void)
{
    const double folded[5 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.1, 0.1, 0.1};
    struct mesh_report r = check(unit, 5, (uint32_t[]){1, 0, 2, 3, 1, 2, 3, 4}, 2);
    CHECK_INT(r.turned_tets, 1);
    CHECK_INT(r.inverted_tets, 0);
    CHECK_INT(r.same_side_faces, 0);
    r = check(folded, 5, (uint32_t[]){0, 1, 2, 3, 1, 2, 3, 4}, 2);
    CHECK_INT(r.turned_tets, 0);
    CHECK_INT(r.orientation, 1);
    CHECK_INT(r.inverted_tets, 1);
    r = check(folded, 5, (uint32_t[]){1, 0, 2, 3, 2, 1, 3, 4}, 2);
    CHECK_INT(r.orientation, -1);
    CHECK_INT(r.inverted_tets, 1);
}

static void test_degenerate_and_duplicate(void)
{
    const double flat[4 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1e-10};
    struct mesh_report r = check(flat, 4, (uint32_t[]){0, 1, 2, 3}, 1);
    CHECK_INT(r.degenerate_tets, 1);
    r = check(unit, 5, (uint32_t[]){0, 1, 2, 3, 3, 1, 0, 2, 1, 2, 3, 4}, 3);
    CHECK_INT(r.duplicate_tets, 1);
    CHECK_INT(r.overfull_faces, 1);
}

static void test_joined_at_a_vertex_and_at_an_edge(void)
{
    const double points[7 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, -1, 0, 0, 0, -1, 0, 0, 0, -1};
    struct mesh_report r = check(points, 7, (uint32_t[]){0, 1, 2, 3, 0, 4, 5, 6}, 2);
    CHECK_INT(r.components, 1);
    CHECK_INT(r.singular_vertices, 1);
    CHECK_INT(r.boundary_singular_edges, 0);
    CHECK_INT(r.boundary_components, 1);
    r = check(points, 7, (uint32_t[]){0, 1, 2, 3, 0, 3, 4, 5}, 2);
    CHECK_INT(r.singular_vertices, 2);
    CHECK_INT(r.boundary_singular_edges, 1);
    CHECK_INT(r.boundary_edges, 11);
    r = check(points, 7, (uint32_t[]){0, 1, 2, 3}, 1);
    CHECK_INT(r.unused_vertices, 3);
}

static void test_apart(void)
{
    const double points[8 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 5, 0, 0, 6, 0, 0, 5, 1, 0, 5, 0, 1};
    struct mesh_report r = check(points, 8, (uint32_t[]){0, 1, 2, 3, 4, 5, 6, 7}, 2);
    CHECK_INT(r.components, 2);
    CHECK_INT(r.boundary_components, 2);
    CHECK_INT(r.euler, 2);
    CHECK_INT(r.singular_vertices, 0);
}

int main(void)
{
    RUN(test_one_tetrahedron);
    RUN(test_two_that_share_a_face);
    RUN(test_numbered_otherwise_and_inverted);
    RUN(test_degenerate_and_duplicate);
    RUN(test_joined_at_a_vertex_and_at_an_edge);
    RUN(test_apart);
    return test_end();
}
