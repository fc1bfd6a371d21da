/* SPDX-License-Identifier: BSD-3-Clause */
/* Surfaces of a cube of six tetrahedra a cell, whose fields are linear: areas and values are known exactly. */
#include <stdlib.h>

#include "src/cut/cut.h"
#include "src/mesh/tet_geom.h"
#include "tests/test.h"

enum { N = 4, SIDE = N + 1 };

static const int steps[6][2] = {{1, 3}, {1, 5}, {2, 3}, {2, 6}, {4, 5}, {4, 6}}; // Kuhn's paths from 0 to 7

static uint32_t corner_id(int x, int y, int z, int corner)
{
    return (uint32_t)((x + (corner & 1)) + SIDE * ((y + (corner >> 1 & 1)) + SIDE * (z + (corner >> 2 & 1))));
}

static void make_cube(struct tetmesh *mesh)
{
    *mesh = (struct tetmesh){.vertex_count = SIDE * SIDE * SIDE, .tet_count = 6 * N * N * N};
    mesh->positions = calloc(mesh->vertex_count, 3 * sizeof(double));
    mesh->corners = calloc(mesh->tet_count, 4 * sizeof(uint32_t));
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (uint32_t axis = 0, rest = v; axis < 3; axis++, rest /= SIDE)
            mesh->positions[3 * v + axis] = (double)(rest % SIDE) / N;
    uint32_t *at = mesh->corners;
    for (int cell = 0; cell < N * N * N; cell++)
        for (int path = 0; path < 6; path++, at += 4) {
            int x = cell % N, y = cell / N % N, z = cell / (N * N);
            at[0] = corner_id(x, y, z, 0);
            at[1] = corner_id(x, y, z, steps[path][0]);
            at[2] = corner_id(x, y, z, steps[path][1]);
            at[3] = corner_id(x, y, z, 7);
        }
}

static void surface_point(const struct tetmesh *mesh, const struct cut *surface, uint32_t vertex, double *out)
{
    for (uint32_t axis = 0; axis < 3; axis++)
        out[axis] = cut_value(surface, vertex, mesh->positions, 3, axis);
}

/* Area vector: its length is the area of a flat surface, its direction the side that the triangles face. */
static void area_vector(const struct tetmesh *mesh, const struct cut *surface, double total[3], double *area)
{
    double p[3][3];
    total[0] = total[1] = total[2] = *area = 0;
    for (size_t t = 0; t < surface->triangle_count; t++) {
        double n[3];
        for (int c = 0; c < 3; c++)
            surface_point(mesh, surface, surface->triangles[3 * t + (size_t)c], p[c]);
        for (int axis = 0; axis < 3; axis++) {
            int i = (axis + 1) % 3, j = (axis + 2) % 3;
            n[axis] = ((p[1][i] - p[0][i]) * (p[2][j] - p[0][j]) - (p[1][j] - p[0][j]) * (p[2][i] - p[0][i])) / 2;
            total[axis] += n[axis];
        }
        *area += sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    }
}

static void test_boundary(void)
{
    struct tetmesh mesh;
    struct cut surface;
    double total[3], area;
    make_cube(&mesh);
    REQUIRE(cut_boundary(&mesh, &surface, NULL) == TETLOD_OK);
    CHECK_INT(surface.triangle_count, 6 * 2 * N * N);
    CHECK_INT(surface.vertex_count, SIDE * SIDE * SIDE - (N - 1) * (N - 1) * (N - 1));
    area_vector(&mesh, &surface, total, &area);
    CHECK_NEAR(area, 6, 1e-12);
    CHECK_NEAR(total[0], 0, 1e-12); // closed
    double volume = 0, p[3][3]; // by the divergence theorem, positive if it is seen from outside
    for (size_t t = 0; t < surface.triangle_count; t++) {
        static const double origin[3] = {0, 0, 0};
        for (int c = 0; c < 3; c++)
            surface_point(&mesh, &surface, surface.triangles[3 * t + (size_t)c], p[c]);
        volume += tet_volume6(origin, p[0], p[1], p[2]) / 6;
    }
    CHECK_NEAR(volume, 1, 1e-12);
    cut_fini(&surface);
    tetmesh_fini(&mesh);
}

static void check_plane(const struct tetmesh *mesh, const double normal[3], double offset, double wanted_area)
{
    struct cut surface;
    double total[3], area;
    double *values = calloc(mesh->vertex_count, sizeof *values);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        values[v] = normal[0] * mesh->positions[3 * v] + normal[1] * mesh->positions[3 * v + 1] +
                    normal[2] * mesh->positions[3 * v + 2] - offset;
    REQUIRE(cut_zero(mesh, values, &surface, NULL) == TETLOD_OK);
    area_vector(mesh, &surface, total, &area);
    double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    CHECK_NEAR(area, wanted_area, 1e-12);
    for (int axis = 0; axis < 3; axis++) // flat, and all triangles face where the values grow
        CHECK_NEAR(total[axis], wanted_area * normal[axis] / length, 1e-12);
    for (uint32_t v = 0; v < surface.vertex_count; v++)
        CHECK_NEAR(cut_value(&surface, v, values, 1, 0), 0, 1e-14);
    for (size_t i = 0; i < 3 * (size_t)surface.triangle_count; i++)
        CHECK(surface.triangles[i] < surface.vertex_count);
    cut_fini(&surface);
    free(values);
}

static void test_sections(void)
{
    struct tetmesh mesh;
    make_cube(&mesh);
    check_plane(&mesh, (const double[]){0, 0, 1}, 0.3, 1);
    check_plane(&mesh, (const double[]){0, 0, 1}, 0.5, 1); // through vertices: faces that two tetrahedra share, once
    check_plane(&mesh, (const double[]){0, 0, -1}, -0.5, 1);
    check_plane(&mesh, (const double[]){1, 1, 1}, 1.5, 3 * sqrt(3) / 4); // the regular hexagon
    check_plane(&mesh, (const double[]){1, 1, 0}, 1, sqrt(2));
    check_plane(&mesh, (const double[]){0, 0, 1}, 1.5, 0);
    tetmesh_fini(&mesh);
}

static void test_inverted_tets(void)
{
    struct tetmesh mesh;
    make_cube(&mesh);
    for (uint32_t t = 0; t < mesh.tet_count; t += 2) { // the same tetrahedra, half of them listed the other way round
        uint32_t first = mesh.corners[4 * t];
        mesh.corners[4 * t] = mesh.corners[4 * t + 1];
        mesh.corners[4 * t + 1] = first;
    }
    check_plane(&mesh, (const double[]){1, 1, 1}, 1.5, 3 * sqrt(3) / 4);
    tetmesh_fini(&mesh);
}

int main(void)
{
    RUN(test_boundary);
    RUN(test_sections);
    RUN(test_inverted_tets);
    return test_end();
}
