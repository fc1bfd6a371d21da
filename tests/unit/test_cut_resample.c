/* SPDX-License-Identifier: BSD-3-Clause */
/* Grids over meshes whose vertices lie on the grid's points, rows and planes, the worst case; points in them; and what
 * rays through them need. */
#include <stdlib.h>

#include "src/cut/rays.h"
#include "src/cut/resample.h"
#include "src/mesh/tet_geom.h"
#include "tests/test.h"

static const double slope[3] = {0.7, -1.3, 2.1};

static double linear(const double p[3])
{
    return 5 + slope[0] * p[0] + slope[1] * p[1] + slope[2] * p[2];
}

static double *linear_values(const struct tetmesh *mesh)
{
    double *values = calloc(mesh->vertex_count, sizeof *values);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        values[v] = linear(mesh->positions + 3 * v);
    return values;
}

static void point_of(const struct cut_grid *grid, size_t i, double out[3])
{
    size_t index[3] = {i % grid->dims[0], i / grid->dims[0] % grid->dims[1], i / grid->dims[0] / grid->dims[1]};
    for (int d = 0; d < 3; d++)
        out[d] = grid->origin[d] + (double)index[d] * grid->spacing[d];
}

static size_t count_of(const struct cut_grid *grid)
{
    return (size_t)grid->dims[0] * grid->dims[1] * grid->dims[2];
}

/* Cubes of six tetrahedra, their inner vertices moved by up to `move` of a cube's side. */
static void make_cube(struct tetmesh *mesh, uint32_t n, double scale, double shift, double move)
{
    static const uint8_t paths[6][4] = {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 4, 5, 7},
                                        {0, 6, 4, 7}};
    uint32_t row = n + 1, state = 5;
    *mesh = (struct tetmesh){.vertex_count = row * row * row, .tet_count = 6 * n * n * n};
    mesh->positions = calloc(mesh->vertex_count, 3 * sizeof(double));
    mesh->corners = calloc(mesh->tet_count, 4 * sizeof(uint32_t));
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        for (uint32_t axis = 0, rest = v; axis < 3; axis++, rest /= row) {
            double x = rest % row;
            state = state * 1664525 + 1013904223;
            if (x > 0 && x < n)
                x += move * ((state >> 8) / 16777216.0 - 0.5);
            mesh->positions[3 * v + axis] = shift + scale * x / n;
        }
    uint32_t *at = mesh->corners;
    for (uint32_t cell = 0; cell < n * n * n; cell++)
        for (int path = 0; path < 6; path++)
            for (int c = 0; c < 4; c++) {
                unsigned corner = paths[path][c];
                *at++ = cell % n + row * (cell / n % n) + row * row * (cell / (n * n)) + (corner & 1) +
                        row * (corner >> 1 & 1) + row * row * (corner >> 2);
            }
}

static void check_cube(uint32_t n, double scale, double shift, double move, uint32_t size)
{
    struct tetmesh mesh;
    struct cut_grid grid = {0};
    make_cube(&mesh, n, scale, shift, move);
    double *values = linear_values(&mesh), low[3] = {shift, shift, shift}, p[3];
    double high[3] = {shift + scale, shift + scale, shift + scale};
    cut_grid_cover(&grid, low, high, size);
    CHECK_INT(count_of(&grid), (size_t)size * size * size);
    REQUIRE(cut_resample(&mesh, values, NULL, &grid, NULL) == TETLOD_OK);
    size_t missed = 0;
    double worst = 0, bound = 1e-6 * (5 + 5 * (scale + fabs(shift))); // float32
    for (size_t i = 0; i < count_of(&grid); i++) {
        point_of(&grid, i, p);
        missed += isnan(grid.values[i]) != 0;
        worst = larger(worst, fabs(grid.values[i] - linear(p)));
    }
    CHECK_INT(missed, 0);
    if (!(worst <= bound))
        TEST_FAIL("a value is off by %g, more than %g (%u cubes of %g at %g)", worst, bound, n, scale, shift);
    free(values);
    cut_grid_fini(&grid);
    tetmesh_fini(&mesh);
}

static void test_no_point_is_missed(void)
{
    check_cube(4, 1, 0, 0, 9);     // on vertices, edges, faces and in the middle
    check_cube(4, 1, 0, 0, 13);    // thirds
    check_cube(6, 1, 0.1, 0, 31);  // rounded coordinates
    check_cube(5, 1e-7, 3, 0, 21); // small, far from zero
    check_cube(5, 1e6, -2e5, 0.9, 27);
    check_cube(9, 1, 0, 0.9, 40);
    check_cube(12, 1, 0, 1, 8); // fewer points than tetrahedra
}

static void test_flat_tets_are_skipped(void)
{
    struct tetmesh mesh;
    struct cut_grid grid = {0};
    make_cube(&mesh, 4, 1, 0, 0);
    for (size_t t = 0; t < mesh.tet_count; t += 5) { // one moved into the plane of its others, in a list of its own
        uint32_t *c = mesh.corners + 4 * t;
        c[3] = c[2] + 1 < mesh.vertex_count ? c[2] + 1 : c[2] - 1;
    }
    double *values = linear_values(&mesh), p[3];
    cut_grid_cover(&grid, (const double[]){0, 0, 0}, (const double[]){1, 1, 1}, 17);
    REQUIRE(cut_resample(&mesh, values, NULL, &grid, NULL) == TETLOD_OK);
    for (size_t i = 0; i < count_of(&grid); i++) {
        point_of(&grid, i, p);
        if (!isnan(grid.values[i]))
            CHECK_NEAR(grid.values[i], linear(p), 1e-5);
    }
    free(values);
    cut_grid_fini(&grid);
    tetmesh_fini(&mesh);
}

/* Outside is outside: a hollow sample, and the same grid used again for a coarser one. */
static void test_outside(void)
{
    const double corners[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    uint32_t ids[4] = {0, 1, 2, 3};
    double values[4] = {0, 1, 2, 4};
    struct tetmesh mesh = {.vertex_count = 4, .tet_count = 1, .positions = (double *)(uintptr_t)corners,
                           .corners = ids};
    struct cut_grid grid = {0};
    static const uint32_t sizes[2] = {33, 9};
    for (int k = 0; k < 2; k++) {
        cut_grid_cover(&grid, (const double[]){-0.5, -0.5, -0.5}, (const double[]){1.5, 1.5, 1.5}, sizes[k]);
        REQUIRE(cut_resample(&mesh, values, NULL, &grid, NULL) == TETLOD_OK);
        for (size_t i = 0; i < count_of(&grid); i++) {
            double p[3];
            point_of(&grid, i, p);
            bool inside = p[0] >= 0 && p[1] >= 0 && p[2] >= 0 && p[0] + p[1] + p[2] <= 1;
            CHECK_INT(!isnan(grid.values[i]), inside);
            if (inside)
                CHECK_NEAR(grid.values[i], p[0] + 2 * p[1] + 4 * p[2], 1e-6);
        }
    }
    cut_grid_fini(&grid);
}

/* One tetrahedron in a grid around it: what is outside is hidden and takes a neighbour's value, a plane fades over one
 * step. */
static void test_voxels(void)
{
    const double corners[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    uint32_t ids[4] = {0, 1, 2, 3};
    double values[4] = {1, 10, 100, 1000};
    struct tetmesh mesh = {.vertex_count = 4, .tet_count = 1, .positions = (double *)(uintptr_t)corners,
                           .corners = ids};
    const struct cut_plane clip = {{0.25, 0, 0}, {2, 0, 0}};
    struct cut_grid grid = {0};
    struct cut_voxels voxels = {0};
    cut_grid_cover(&grid, (const double[]){-0.5, -0.5, -0.5}, (const double[]){1.5, 1.5, 1.5}, 33);
    REQUIRE(cut_resample(&mesh, values, NULL, &grid, NULL) == TETLOD_OK);
    for (int k = 0; k < 3; k++) {
        REQUIRE(cut_make_voxels(&grid, k == 1, k == 2 ? &clip : NULL, &voxels, NULL) == TETLOD_OK);
        for (size_t i = 0; i < count_of(&grid); i++) {
            double p[3], value = voxels.pairs[2 * i], seen = voxels.pairs[2 * i + 1];
            point_of(&grid, i, p);
            bool inside = p[0] >= 0 && p[1] >= 0 && p[2] >= 0 && p[0] + p[1] + p[2] <= 1;
            if (inside) {
                double there = 1 + 9 * p[0] + 99 * p[1] + 999 * p[2];
                CHECK_NEAR(value, k == 1 ? log10(there) : there, 1e-3);
                CHECK_NEAR(seen, k < 2 || p[0] < 0.21 ? 1 : p[0] < 0.26 ? 0.5 : 0, 1e-6);
            } else
                CHECK(seen == 0 && value >= voxels.range[0] && value <= voxels.range[1]);
        }
        CHECK_NEAR(voxels.range[0], k == 1 ? 0 : 1, 1e-6);
        CHECK_NEAR(voxels.range[1], k == 1 ? 3 : 1000, 1e-3);
    }
    size_t rim = 8 + 33 * (8 + 33 * 24) - 1; // beside the last corner, whose value is the largest
    CHECK_NEAR(voxels.pairs[2 * rim], 1000, 1e-3);
    cut_grid_fini(&grid);
    cut_voxels_fini(&voxels);
}

static void test_cover(void)
{
    struct cut_grid grid = {0};
    cut_grid_cover(&grid, (const double[]){1, 2, 3}, (const double[]){5, 4, 3}, 65);
    CHECK_INT(grid.dims[0], 65);
    CHECK_INT(grid.dims[1], 33);
    CHECK_INT(grid.dims[2], 2); // also of a flat box
    CHECK_NEAR(grid.origin[1] + 32 * grid.spacing[1], 4, 1e-12);
    CHECK(grid.spacing[2] > 0);
    grid.dims[0] = grid.dims[1] = 1u << 20;
    struct tetlod_error error;
    CHECK_INT(cut_resample(&(struct tetmesh){0}, NULL, NULL, &grid, &error), TETLOD_ERR_LIMIT);
}

static void test_probe(void)
{
    struct tetmesh mesh;
    make_cube(&mesh, 6, 2, -1, 0.9);
    double *values = linear_values(&mesh), weights[4];
    uint32_t state = 3;
    for (int k = 0; k < 2000; k++) {
        double p[3], value = 0, at[3] = {0};
        for (int d = 0; d < 3; d++) {
            state = state * 1664525 + 1013904223;
            p[d] = k < 20 ? mesh.positions[3 * (size_t)(k * 17) + (size_t)d] : 2 * ((state >> 8) / 16777216.0) - 1;
        }
        uint32_t tet = cut_probe(&mesh, p, 0, weights);
        REQUIRE(tet != TETLOD_NONE);
        for (size_t c = 0; c < 4; c++) {
            uint32_t v = mesh.corners[4 * (size_t)tet + c];
            CHECK(weights[c] >= 0 && weights[c] <= 1 + 1e-12);
            value += weights[c] * values[v];
            for (size_t d = 0; d < 3; d++)
                at[d] += weights[c] * mesh.positions[3 * (size_t)v + d];
        }
        CHECK_NEAR(value, linear(p), 1e-7);
        CHECK_NEAR(sqrt(distance_squared(at, p)), 0, 1e-7);
    }
    const double near[3] = {0.3, 0.2, 1.001}, far[3] = {0.3, 0.2, 1.02};
    CHECK(cut_probe(&mesh, near, 0.002, weights) != TETLOD_NONE); // picked on a picture of float32
    CHECK_NEAR(weights[0] + weights[1] + weights[2] + weights[3], 1, 1e-12);
    CHECK(cut_probe(&mesh, near, 0, weights) == TETLOD_NONE);
    CHECK(cut_probe(&mesh, far, 0.002, weights) == TETLOD_NONE);
    free(values);
    tetmesh_fini(&mesh);
}

/* Every face of the boundary is in one leaf, and in the boxes above that; all are seen from outside. */
static void check_tree(const struct tetmesh *mesh, const struct cut_rays *rays, const double centre[3])
{
    size_t found = 0;
    double six_volumes = 0;
    for (uint32_t i = 0; i < rays->node_count; i++) {
        const float *node = rays->nodes + 8 * (size_t)i;
        CHECK(node[3] > (float)i && node[3] <= (float)rays->node_count);
        for (uint32_t below = i; below < (uint32_t)node[3]; below++) {
            const float *leaf = rays->nodes + 8 * (size_t)below;
            for (uint32_t f = 0; f < RAYS_LEAF && leaf[7] >= 0; f++) {
                const uint32_t *face = rays->faces + 4 * (RAYS_LEAF * (size_t)leaf[7] + f);
                for (int k = 0; k < 3 && face[3] != TETLOD_NONE; k++)
                    for (int d = 0; d < 3; d++) {
                        float x = rays->vertices[4 * (size_t)face[k] + (size_t)d];
                        CHECK(x >= node[d] && x <= node[4 + d]);
                        CHECK_NEAR((double)x, mesh->positions[3 * (size_t)face[k] + (size_t)d] - centre[d], 1e-6);
                    }
                if (face[3] == TETLOD_NONE || i)
                    continue;
                found++;
                CHECK_INT(rays->neighbours[face[3]], TETLOD_NONE);
                six_volumes += tet_volume6(centre, mesh->positions + 3 * (size_t)face[0],
                                           mesh->positions + 3 * (size_t)face[1],
                                           mesh->positions + 3 * (size_t)face[2]);
            }
        }
    }
    CHECK_INT(found, 12 * 4 * 4);
    CHECK_NEAR(six_volumes, 6 * 8, 1e-9);
}

static void test_rays(void)
{
    struct tetmesh mesh;
    struct cut_rays rays = {0};
    const double centre[3] = {4, 4, 4};
    make_cube(&mesh, 4, 2, 3, 0.2);
    uint32_t swap = mesh.corners[0]; // one is inside out
    mesh.corners[0] = mesh.corners[1];
    mesh.corners[1] = swap;
    double *values = linear_values(&mesh);
    REQUIRE(cut_rays_connect(&mesh, &rays, NULL) == TETLOD_OK);
    REQUIRE(cut_rays_place(&mesh, values, NULL, centre, &rays, NULL) == TETLOD_OK);
    for (uint32_t slot = 0; slot < 4 * mesh.tet_count; slot++)
        CHECK(rays.neighbours[slot] == TETLOD_NONE || rays.neighbours[rays.neighbours[slot]] == slot);
    check_tree(&mesh, &rays, centre);
    for (size_t i = 0; i < 3 * (size_t)mesh.vertex_count; i++) // the boxes follow
        mesh.positions[i] = 8 - mesh.positions[i];
    REQUIRE(cut_rays_place(&mesh, values, NULL, centre, &rays, NULL) == TETLOD_OK);
    for (size_t i = 0; i < rays.face_count; i++) { // mirrored
        uint32_t *face = rays.faces + 4 * i, first = face[0];
        face[0] = face[1];
        face[1] = first;
    }
    check_tree(&mesh, &rays, centre);
    free(values);
    cut_rays_fini(&rays);
    tetmesh_fini(&mesh);
}

static void test_rays_of_nothing(void)
{
    struct tetmesh mesh = {0};
    struct cut_rays rays = {0};
    const double centre[3] = {0};
    REQUIRE(cut_rays_connect(&mesh, &rays, NULL) == TETLOD_OK);
    REQUIRE(cut_rays_place(&mesh, centre, NULL, centre, &rays, NULL) == TETLOD_OK);
    CHECK_INT(rays.face_count + rays.node_count, 0);
    cut_rays_fini(&rays);
}

int main(void)
{
    RUN(test_no_point_is_missed);
    RUN(test_flat_tets_are_skipped);
    RUN(test_outside);
    RUN(test_voxels);
    RUN(test_cover);
    RUN(test_probe);
    RUN(test_rays);
    RUN(test_rays_of_nothing);
    return test_end();
}
