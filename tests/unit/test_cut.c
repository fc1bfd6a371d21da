/* SPDX-License-Identifier: BSD-3-Clause */
/* Surfaces of a cube of six tetrahedra a cell, whose fields are linear: areas and values are known exactly. */
#include <stdlib.h>

#include "src/cut/cut.h"
#include "src/cut/cut_solid.h"
#include "src/cut/line.h"
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
    struct cut surface = {0};
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

static double *plane_values(const struct tetmesh *mesh, const double normal[3], double offset)
{
    double *values = calloc(mesh->vertex_count, sizeof *values);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        values[v] = normal[0] * mesh->positions[3 * v] + normal[1] * mesh->positions[3 * v + 1] +
                    normal[2] * mesh->positions[3 * v + 2] - offset;
    return values;
}

static void check_plane(const struct tetmesh *mesh, const double normal[3], double offset, double wanted_area)
{
    struct cut surface = {0};
    double total[3], area;
    double *values = plane_values(mesh, normal, offset);
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

/* Every edge runs as often one way as the other, so that the surface has no rim; and its volume is that of the part. */
static void check_closed(const struct tetmesh *mesh, const struct cut *surface, double wanted_volume)
{
    static const double origin[3] = {0, 0, 0};
    uint32_t n = surface->vertex_count;
    int *balance = calloc((size_t)n * n, sizeof *balance);
    double volume = 0, p[3][3];
    for (size_t t = 0; t < surface->triangle_count; t++) {
        const uint32_t *triangle = surface->triangles + 3 * t;
        for (int c = 0; c < 3; c++) {
            uint32_t a = triangle[c], b = triangle[(c + 1) % 3];
            balance[(size_t)(a < b ? a : b) * n + (a < b ? b : a)] += a < b ? 1 : -1;
            surface_point(mesh, surface, triangle[c], p[c]);
        }
        volume += tet_volume6(origin, p[0], p[1], p[2]) / 6;
    }
    for (size_t i = 0; i < (size_t)n * n; i++)
        if (balance[i])
            TEST_FAIL("the edge %zu, %zu is %d times open", i / n, i % n, balance[i]);
    CHECK_NEAR(volume, wanted_volume, 1e-12);
    free(balance);
}

/* The section's cells are a division of a disc: Euler's number tells whether every edge is there, once. */
static void check_section_lines(struct cut *section, const double *values, uint32_t cells)
{
    REQUIRE(cut_lines(section, values, NULL) == TETLOD_OK);
    CHECK_INT(section->vertex_count - section->line_count + cells, cells ? 1 : 0);
    for (size_t i = 0; i < section->line_count; i++)
        for (size_t j = 0; j < i; j++)
            CHECK((section->lines[2 * i] ^ section->lines[2 * j]) != 0 ||
                  section->lines[2 * i + 1] != section->lines[2 * j + 1]);
    for (size_t i = 0; i < 2 * (size_t)section->line_count; i++)
        CHECK_NEAR(cut_value(section, section->lines[i], values, 1, 0), 0, 1e-14);
}

static void test_lines(void)
{
    struct tetmesh mesh;
    struct cut cut = {0};
    make_cube(&mesh);
    REQUIRE(cut_boundary(&mesh, &cut, NULL) == TETLOD_OK && cut_lines(&cut, NULL, NULL) == TETLOD_OK);
    CHECK_INT(cut.vertex_count - cut.line_count + cut.triangle_count, 2); // a sphere
    static const double planes[4][4] = {{0, 0, 1, 0.3}, {1, 1, 1, 1.4}, {0.3, 0.5, 0.7, 0.61}, {0, 0, 1, 2}};
    for (int i = 0; i < 4; i++) {
        double *values = plane_values(&mesh, planes[i], planes[i][3]);
        uint32_t cells = 0;
        for (size_t t = 0; t < mesh.tet_count; t++) {
            int below = 0;
            for (int c = 0; c < 4; c++)
                below += values[mesh.corners[4 * t + (size_t)c]] < 0;
            cells += below > 0 && below < 4;
        }
        REQUIRE(cut_zero(&mesh, values, &cut, NULL) == TETLOD_OK); // in the memory of the last one
        check_section_lines(&cut, values, cells);
        free(values);
    }
    // through vertices: the faces of a square grid, halved
    double *values = plane_values(&mesh, (const double[]){0, 0, 1}, 0.5);
    REQUIRE(cut_zero(&mesh, values, &cut, NULL) == TETLOD_OK);
    check_section_lines(&cut, values, 2 * N * N);
    free(values);
    cut_fini(&cut);
    tetmesh_fini(&mesh);
}

static void check_clip(const struct tetmesh *mesh, const double normal[3], double offset, double volume)
{
    struct cut boundary = {0}, part = {0};
    double *values = plane_values(mesh, normal, offset);
    REQUIRE(cut_boundary(mesh, &boundary, NULL) == TETLOD_OK);
    REQUIRE(cut_clip(mesh, &boundary, values, &part, NULL) == TETLOD_OK);
    check_closed(mesh, &part, volume);
    for (uint32_t v = 0; v < part.vertex_count; v++)
        CHECK(cut_value(&part, v, values, 1, 0) < 1e-14);
    REQUIRE(cut_lines(&part, values, NULL) == TETLOD_OK);
    for (size_t i = 0; i < part.line_count; i++) { // a line off the section is part of an edge of the mesh
        double p[3], q[3];
        surface_point(mesh, &part, part.lines[2 * i], p);
        surface_point(mesh, &part, part.lines[2 * i + 1], q);
        double middle = (cut_value(&part, part.lines[2 * i], values, 1, 0) + cut_value(&part, part.lines[2 * i + 1],
                                                                                       values, 1, 0)) / 2;
        if (middle > -1e-12)
            continue;
        double least = 1, most = 0; // of the steps that are not 0: the cubes' edges and diagonals have equal steps
        for (int axis = 0; axis < 3; axis++) {
            double step = fabs(q[axis] - p[axis]);
            if (step > 1e-12) {
                least = step < least ? step : least;
                most = step > most ? step : most;
            }
        }
        CHECK_NEAR(least, most, 1e-12);
    }
    free(values);
    cut_fini(&boundary);
    cut_fini(&part);
}

static void test_clip(void)
{
    struct tetmesh mesh;
    make_cube(&mesh);
    check_clip(&mesh, (const double[]){0, 0, 1}, 0.3, 0.3);
    check_clip(&mesh, (const double[]){0, 0, 1}, 0.5, 0.5); // through vertices
    check_clip(&mesh, (const double[]){0, 0, -1}, -0.5, 0.5);
    check_clip(&mesh, (const double[]){1, 1, 1}, 1.5, 0.5);
    check_clip(&mesh, (const double[]){1, 1, 1}, 0.7, 0.7 * 0.7 * 0.7 / 6);
    check_clip(&mesh, (const double[]){1, 1, 0}, 1, 0.5);
    check_clip(&mesh, (const double[]){1, 0, 0}, 2, 1); // all of it
    check_clip(&mesh, (const double[]){1, 0, 0}, 0, 0); // nothing
    mesh.tet_count -= 100; // with a rugged boundary
    double volume = 0;
    struct cut boundary = {0};
    REQUIRE(cut_boundary(&mesh, &boundary, NULL) == TETLOD_OK);
    for (size_t t = 0; t < mesh.tet_count; t++)
        volume += 1.0 / (6 * N * N * N);
    check_closed(&mesh, &boundary, volume);
    cut_fini(&boundary);
    check_clip(&mesh, (const double[]){1, 1, 1}, 3.5, volume);
    check_clip(&mesh, (const double[]){0, 0, 1}, 0.4, 0.4);
    tetmesh_fini(&mesh);
}

/* A section and the part of it behind another plane, whose area and length of lines are known. */
static void check_trim(const struct tetmesh *mesh, const double normal[3], double offset, double wanted_area,
                       bool all_lines)
{
    struct cut surface = {0}, part = {0};
    double *function = plane_values(mesh, (const double[]){0, 0, 1}, 0.3), total[3], area;
    REQUIRE(cut_zero(mesh, function, &surface, NULL) == TETLOD_OK && cut_lines(&surface, function, NULL) == TETLOD_OK);
    double *points = calloc(surface.vertex_count, 3 * sizeof *points);
    for (uint32_t v = 0; v < surface.vertex_count; v++)
        surface_point(mesh, &surface, v, points + 3 * (size_t)v);
    const struct tetmesh flat = {.vertex_count = surface.vertex_count, .positions = points};
    double *distances = plane_values(&flat, normal, offset);
    REQUIRE(cut_trim(&surface, distances, &part, NULL) == TETLOD_OK);
    area_vector(&flat, &part, total, &area);
    CHECK_NEAR(area, wanted_area, 1e-12);
    CHECK_NEAR(total[2], wanted_area, 1e-12); // none is turned over
    for (uint32_t v = 0; v < part.vertex_count; v++)
        CHECK(cut_value(&part, v, distances, 1, 0) < 1e-14);
    CHECK(all_lines ? part.line_count == surface.line_count : part.line_count < surface.line_count);
    for (size_t i = 0; i < 2 * (size_t)part.line_count; i++)
        CHECK(part.lines[i] < part.vertex_count);
    free(function);
    free(distances);
    free(points);
    cut_fini(&surface);
    cut_fini(&part);
}

static void test_trim(void)
{
    struct tetmesh mesh;
    make_cube(&mesh);
    check_trim(&mesh, (const double[]){1, 0, 0}, 0.4, 0.4, false);
    check_trim(&mesh, (const double[]){1, 0, 0}, 0.5, 0.5, false); // through vertices of the section
    check_trim(&mesh, (const double[]){1, 1, 0}, 0.7, 0.7 * 0.7 / 2, false);
    check_trim(&mesh, (const double[]){0, -1, 0}, -0.9, 0.1, false);
    check_trim(&mesh, (const double[]){1, 0, 0}, 2, 1, true); // all of it
    check_trim(&mesh, (const double[]){1, 0, 0}, -1, 0, false);
    tetmesh_fini(&mesh);
}

/* Moves every vertex inside the cube: tetrahedra of all shapes, none of them inverted. */
static void jitter(struct tetmesh *mesh, double most)
{
    uint32_t state = 7;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (uint32_t axis = 0; axis < 3; axis++) {
            double *x = &mesh->positions[3 * v + axis];
            state = state * 1664525 + 1013904223;
            if (*x > 0 && *x < 1)
                *x += most / N * ((state >> 8) / 16777216.0 - 0.5);
        }
}

static void test_isosurface_normals(void)
{
    struct tetmesh mesh;
    struct cut shell = {0};
    make_cube(&mesh);
    jitter(&mesh, 0.3);
    double *values = calloc(mesh.vertex_count, sizeof *values);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        for (uint32_t axis = 0; axis < 3; axis++)
            values[v] += (mesh.positions[3 * v + axis] - 0.5) * (mesh.positions[3 * v + axis] - 0.5);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        values[v] = sqrt(values[v]) - 0.35;
    REQUIRE(cut_zero(&mesh, values, &shell, NULL) == TETLOD_OK);
    float *points = calloc(shell.vertex_count, 3 * sizeof *points), *normals = calloc(shell.vertex_count,
                                                                                      3 * sizeof *normals);
    for (uint32_t i = 0; i < 3 * shell.vertex_count; i++)
        points[i] = (float)(cut_value(&shell, i / 3, mesh.positions, 3, i % 3) - 0.5);
    cut_normals(&shell, points, normals);
    for (uint32_t v = 0; v < shell.vertex_count; v++) {
        const float *p = points + 3 * v, *n = normals + 3 * v;
        double r = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        CHECK_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-5);
        CHECK((n[0] * p[0] + n[1] * p[1] + n[2] * p[2]) / r > 0.8); // outwards, where the values grow
    }
    for (uint32_t i = 0; i < 3 * shell.vertex_count; i++)
        points[i] *= 1e-12f; // so small that squares of areas are nothing in float32
    float first[3] = {normals[0], normals[1], normals[2]};
    cut_normals(&shell, points, normals);
    for (int i = 0; i < 3; i++)
        CHECK_NEAR(normals[i], first[i], 1e-4);
    free(points);
    free(normals);
    free(values);
    cut_fini(&shell);
    tetmesh_fini(&mesh);
}

/* A face that three tetrahedra have, and tetrahedra that are listed twice: what is left has no rim all the same. */
static void check_overfull(uint32_t tets, uint32_t wanted_triangles)
{
    double positions[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.3, 0.3, -1};
    uint32_t corners[16] = {0, 1, 2, 3, 0, 2, 1, 4, 0, 1, 2, 3, 0, 1, 2, 3};
    struct tetmesh mesh = {.vertex_count = 5, .tet_count = tets, .positions = positions, .corners = corners};
    struct cut surface = {0};
    int odd[5][5] = {{0}};
    REQUIRE(cut_boundary(&mesh, &surface, NULL) == TETLOD_OK);
    CHECK_INT(surface.triangle_count, wanted_triangles);
    for (size_t i = 0; i < 3 * (size_t)surface.triangle_count; i++) {
        uint32_t a = surface.triangles[i], b = surface.triangles[i % 3 == 2 ? i - 2 : i + 1];
        odd[a < b ? a : b][a < b ? b : a] ^= 1;
    }
    for (int i = 0; i < 25; i++)
        CHECK_INT(odd[i / 5][i % 5], 0);
    cut_fini(&surface);
}

static void test_boundary_of_overfull_faces(void)
{
    check_overfull(3, 4); // the first and the third cancel, the second is left
    check_overfull(4, 6);
}

/* A linear field along a line through the cube is linear: pieces meet, and begin and end at the walls. */
static void test_values_along_a_line(void)
{
    struct tetmesh mesh;
    struct cut_line line = {0};
    make_cube(&mesh);
    double *values = calloc(mesh.vertex_count, sizeof *values);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        values[v] = mesh.positions[3 * v] + 10 * mesh.positions[3 * v + 1] - 2 * mesh.positions[3 * v + 2];
    static const double segments[][2][3] = {{{-1, 0.3, 0.41}, {2, 0.6, 0.55}}, {{0.1, 0.2, 0.3}, {0.9, 0.8, 0.7}},
                                            {{0, 0, 0}, {1, 1, 1}},
                                            {{0.25, 0.25, -1}, {0.25, 0.25, 2}}, {{1, 0, 0.5}, {1, 1, 0.5}}};
    for (size_t s = 0; s < sizeof segments / sizeof *segments; s++) {
        const double *a = segments[s][0], *b = segments[s][1];
        CHECK(cut_along(&mesh, values, NULL, a, b, &line, NULL) == TETLOD_OK && line.count > 0);
        double covered = 0;
        for (uint32_t k = 0; k < 2 * line.count; k++) {
            double p[3];
            for (int i = 0; i < 3; i++)
                p[i] = a[i] + line.ends[k].at * (b[i] - a[i]);
            CHECK(fabs(line.ends[k].value - (p[0] + 10 * p[1] - 2 * p[2])) < 1e-12);
            CHECK(k == 0 || line.ends[k].at >= line.ends[k - 1].at);
            CHECK(k % 2 == 0 || k + 1 == 2 * line.count || line.ends[k + 1].at - line.ends[k].at < 1e-9); // no gap
            covered += k % 2 ? line.ends[k].at : -line.ends[k].at;
        }
        CHECK(fabs(covered - (line.ends[2 * line.count - 1].at - line.ends[0].at)) < 1e-9);
    }
    CHECK(cut_along(&mesh, values, NULL, (double[3]){2, 0, 0}, (double[3]){2, 1, 1}, &line, NULL) == TETLOD_OK &&
          line.count == 0);
    free(values);
    cut_line_fini(&line);
    tetmesh_fini(&mesh);
}

/* Room for new vertices behind an array of the mesh. */
static double *extended(const struct cut_solid *solid, const double *values, uint32_t components)
{
    double *out = calloc((size_t)solid->old_count + solid->new_count, components * sizeof *out);
    memcpy(out, values, (size_t)solid->old_count * components * sizeof *out);
    cut_solid_extend(solid, out, components);
    return out;
}

/* What is left of the cube in a box: its places; `tets`: the numbers of the cube's. */
static double *cut_box(const struct tetmesh *cube, const double box[6], struct cut_solid *solid)
{
    uint32_t *tets = calloc(cube->tet_count, sizeof *tets);
    for (uint32_t t = 0; t < cube->tet_count; t++)
        tets[t] = t;
    CHECK(cut_solid_begin(cube->vertex_count, cube->corners, tets, cube->tet_count, solid, NULL) == TETLOD_OK);
    free(tets);
    double *places = extended(solid, cube->positions, 3);
    for (int side = 0; side < 6; side++) {
        double *values = calloc((size_t)solid->old_count + solid->new_count, sizeof *values);
        for (size_t v = 0; v < (size_t)solid->old_count + solid->new_count; v++)
            values[v] = (side < 3 ? -1 : 1) * (places[3 * v + (size_t)(side % 3)] - box[side]);
        CHECK(cut_solid_below(solid, values, NULL) == TETLOD_OK);
        free(values);
        free(places);
        places = extended(solid, cube->positions, 3);
    }
    return places;
}

/* Edges of the surface, as lengths: those of the cut ones of the cube's faces, without what only divides them. */
static double length_of_lines(const struct tetmesh *mesh, struct cut *surface, const struct cut_solid *solid)
{
    double sum = 0;
    CHECK(cut_lines(surface, NULL, NULL) == TETLOD_OK);
    for (size_t l = 0; l < surface->line_count; l++) {
        double p[2][3], squares = 0;
        uint32_t ends[4];
        for (size_t i = 0; i < 2; i++) {
            memcpy(ends + 2 * i, surface->ends + 2 * (size_t)surface->lines[2 * l + i], 2 * sizeof *ends);
            surface_point(mesh, surface, surface->lines[2 * l + i], p[i]);
        }
        for (int axis = 0; axis < 3; axis++)
            squares += (p[1][axis] - p[0][axis]) * (p[1][axis] - p[0][axis]);
        sum += cut_solid_is_edge(solid, ends, 4, false) ? sqrt(squares) : 0;
    }
    return sum;
}

static double volume6_of(const struct tetmesh *mesh, const uint32_t *c)
{
    const double *p = mesh->positions;
    return tet_volume6(p + 3 * (size_t)c[0], p + 3 * (size_t)c[1], p + 3 * (size_t)c[2], p + 3 * (size_t)c[3]);
}

/* The lines of the section along one side of a box, as far as they are in it. */
static double length_of_section(const struct tetmesh *cube, const double box[6], int side)
{
    struct cut cuts[6] = {{0}};
    double *values = calloc(cube->vertex_count, sizeof *values), sum = 0, *places = cube->positions;
    for (uint32_t v = 0; v < cube->vertex_count; v++)
        values[v] = places[3 * v + (uint32_t)(side % 3)] - box[side];
    CHECK(cut_zero(cube, values, &cuts[0], NULL) == TETLOD_OK && cut_lines(&cuts[0], values, NULL) == TETLOD_OK);
    for (int k = 0, last = 0; k < 6; k++) {
        if (k % 3 == side % 3)
            continue;
        double *moved = calloc(cuts[last].vertex_count + 1, 3 * sizeof *moved);
        for (uint32_t v = 0; v < cuts[last].vertex_count; v++)
            for (uint32_t axis = 0; axis < 3; axis++)
                moved[3 * v + axis] = cut_value(&cuts[last], v, places, 3, axis);
        if (places != cube->positions)
            free(places);
        places = moved;
        values = realloc(values, (cuts[last].vertex_count + 1) * sizeof *values);
        for (uint32_t v = 0; v < cuts[last].vertex_count; v++)
            values[v] = (k < 3 ? -1 : 1) * (places[3 * v + (uint32_t)(k % 3)] - box[k]);
        CHECK(cut_trim(&cuts[last], values, &cuts[last + 1], NULL) == TETLOD_OK);
        last++;
        sum = 0;
        for (size_t l = 0; l < cuts[last].line_count; l++) {
            double squares = 0;
            for (uint32_t axis = 0; axis < 3; axis++) {
                double d = cut_value(&cuts[last], cuts[last].lines[2 * l], places, 3, axis) -
                           cut_value(&cuts[last], cuts[last].lines[2 * l + 1], places, 3, axis);
                squares += d * d;
            }
            sum += sqrt(squares);
        }
    }
    free(places);
    free(values);
    for (int i = 0; i < 6; i++)
        cut_fini(&cuts[i]);
    return sum;
}

/* Tetrahedra in a box fill it, keep their orientation and fit each other: the surface is the box's alone. */
static void test_box(void)
{
    struct tetmesh cube, part = {0};
    struct cut_solid solid = {0};
    struct cut surface = {0};
    make_cube(&cube);
    static const double boxes[][6] = {{0.1, 0.2, 0.3, 0.9, 0.7, 0.85}, {0.25, 0.25, 0.25, 0.75, 0.75, 0.75},
                                      {0.25, 0.3, 0, 0.5, 0.8, 1},     {0.26, 0.26, 0.26, 0.27, 0.28, 0.29},
                                      {0, 0, 0, 1, 1, 1},              {0.1, 0.25, 0.5, 0.3, 0.5, 0.51}};
    for (size_t b = 0; b < sizeof boxes / sizeof *boxes; b++) {
        double *places = cut_box(&cube, boxes[b], &solid), volume = 0, total[3], area, sides[3];
        part = (struct tetmesh){.vertex_count = solid.old_count + solid.new_count, .tet_count = solid.tet_count,
                                .positions = places, .corners = solid.corners};
        for (size_t t = 0; t < part.tet_count; t++) {
            const uint32_t *c = part.corners + 4 * t, *own = cube.corners + 4 * (size_t)solid.tets[t];
            double six = volume6_of(&part, c);
            CHECK((six > 0) == (volume6_of(&cube, own) > 0));
            volume += fabs(six) / 6;
        }
        for (int axis = 0; axis < 3; axis++)
            sides[axis] = boxes[b][3 + axis] - boxes[b][axis];
        CHECK_NEAR(volume, sides[0] * sides[1] * sides[2], 1e-12);
        CHECK(cut_boundary(&part, &surface, NULL) == TETLOD_OK);
        area_vector(&part, &surface, total, &area);
        CHECK_NEAR(area, 2 * (sides[0] * sides[1] + sides[1] * sides[2] + sides[2] * sides[0]), 1e-12);
        if (b == 0) { // what the box's sides cut of faces, and its own edges
            double lines = 4 * (sides[0] + sides[1] + sides[2]);
            for (int side = 0; side < 6; side++)
                lines += length_of_section(&cube, boxes[b], side);
            CHECK_NEAR(length_of_lines(&part, &surface, &solid), lines, 1e-12);
        }
        free(places);
    }
    free(cube.positions);
    free(cube.corners);
    cut_fini(&surface);
    cut_solid_fini(&solid);
}

int main(void)
{
    RUN(test_boundary);
    RUN(test_sections);
    RUN(test_inverted_tets);
    RUN(test_lines);
    RUN(test_clip);
    RUN(test_trim);
    RUN(test_isosurface_normals);
    RUN(test_boundary_of_overfull_faces);
    RUN(test_values_along_a_line);
    RUN(test_box);
    return test_end();
}
