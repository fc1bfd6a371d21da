/* SPDX-License-Identifier: BSD-3-Clause */
/* Points in tetrahedra and closest points of the boundary, against looking at all of them. */
#include "src/mesh/locate.h"

#include <stdlib.h>

#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/test.h"

static double least(const double w[4])
{
    return smaller(smaller(w[0], w[1]), smaller(w[2], w[3]));
}

/* All tetrahedra that contain p. */
static uint32_t find_all(const struct locator *locator, const double p[3], uint32_t *out, uint32_t most)
{
    uint32_t count = 0;
    for (uint32_t t = 0; t < locator->tet_count; t++) {
        double weights[4];
        if (locator_weights(locator, t, p, weights) >= -1e-9 && count < most)
            out[count++] = t;
    }
    return count;
}

/* How far p is from a triangle: its plane, edges and corners, by the closest point of each that is inside it. */
static double triangle_distance(const double p[3], const double *a, const double *b, const double *c)
{
    const double *corner[3] = {a, b, c};
    double best = INFINITY, n[3], u[3], v[3], w[3], size = 0, height = 0;
    for (int d = 0; d < 3; d++) {
        u[d] = b[d] - a[d];
        v[d] = c[d] - a[d];
        w[d] = p[d] - a[d];
    }
    for (int d = 0; d < 3; d++)
        n[d] = u[(d + 1) % 3] * v[(d + 2) % 3] - u[(d + 2) % 3] * v[(d + 1) % 3];
    for (int d = 0; d < 3; d++) {
        size += n[d] * n[d];
        height += n[d] * w[d];
    }
    int inside = 1;
    for (int e = 0; e < 3; e++) {
        const double *from = corner[e], *to = corner[(e + 1) % 3];
        double t = 0, length = distance_squared(from, to), side = 0, at[3];
        for (int d = 0; d < 3; d++) {
            int i = (d + 1) % 3, j = (d + 2) % 3;
            t += (p[d] - from[d]) * (to[d] - from[d]);
            side += n[d] * ((to[i] - from[i]) * (p[j] - from[j]) - (to[j] - from[j]) * (p[i] - from[i]));
        }
        t = fmin(1, fmax(0, t / length));
        for (int d = 0; d < 3; d++)
            at[d] = from[d] + t * (to[d] - from[d]);
        best = smaller(best, sqrt(distance_squared(p, at)));
        inside &= side >= 0;
    }
    return inside ? fabs(height) / sqrt(size) : best;
}

static double closest_of_all(const struct locator *locator, const double p[3])
{
    double best = INFINITY;
    for (uint32_t t = 0; t < locator->surface.count; t++) {
        const uint32_t *v = locator->surface.triangles + 3 * t;
        best = smaller(best, triangle_distance(p, locator->positions + 3 * v[0], locator->positions + 3 * v[1],
                                               locator->positions + 3 * v[2]));
    }
    return best;
}

/* p again from a place's weights, which are a convex combination. */
static double place_error(const struct locator *locator, const struct place *place, double distance, const double p[3])
{
    double at[3] = {0, 0, 0}, sum = 0;
    for (int i = 0; i < 4; i++) {
        sum += place->weights[i];
        for (int d = 0; d < 3 && place->weights[i] != 0; d++)
            at[d] += place->weights[i] * locator->positions[3 * place->vertices[i] + d];
    }
    return fabs(sqrt(distance_squared(at, p)) - distance) + fabs(sum - 1) + (least(place->weights) < -1e-12);
}

/* What is near enough may be anywhere on the boundary but is no nearer than it is; without that, the distance. */
static bool distances_agree(const struct locator *locator, const double p[3], double distance)
{
    uint32_t face = TETLOD_NONE, closest;
    struct place place;
    double near = mesh_surface_distance(&locator->surface, 0, p, 2 * distance, &face);
    bool right = face != TETLOD_NONE && near >= distance && near <= 2 * distance;
    right &= mesh_surface_closest(&locator->surface, 0, p, &place, &closest) == distance;
    return right && mesh_surface_distance(&locator->surface, 0, p, 0, &face) == distance && face == closest;
}

static void check_point(const struct locator *locator, const double p[3], double size, unsigned *wrong)
{
    uint32_t all[64], found[64], count = find_all(locator, p, all, 64);
    wrong[0] += locator_find(locator, p, found, 64) != count;
    for (uint32_t i = 0; i < count; i++) {
        unsigned there = 0;
        for (uint32_t j = 0; j < count; j++)
            there += found[j] == all[i];
        wrong[0] += there != 1;
    }
    double weights[4];
    uint32_t walked = locator_walk(locator, all[0] % locator->tet_count * (count > 0), p, weights);
    walked = walked == TETLOD_NONE ? locator_walk(locator, 0, p, weights) : walked;
    wrong[1] += walked != TETLOD_NONE && (!count || least(weights) < -1e-9);
    wrong[1] += count == 1 && walked == TETLOD_NONE; // begun in the right one at least
    struct place place;
    double distance = locator_closest(locator, p, &place);
    wrong[2] += !(fabs(distance - closest_of_all(locator, p)) <= 1e-9 * size);
    wrong[2] += !distances_agree(locator, p, distance);
    wrong[3] += !(place_error(locator, &place, distance, p) <= 1e-9 * size + 1e-9);
}

static void check_mesh(const struct tetmesh *mesh, int points)
{
    struct locator locator;
    uint64_t random = 5;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    unsigned wrong[4] = {0};
    REQUIRE(locator_init(&locator, mesh->positions, mesh->vertex_count, mesh->corners, mesh->tet_count,
                         NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < 3 * mesh->vertex_count; v++) {
        low[v % 3] = smaller(low[v % 3], mesh->positions[v]);
        high[v % 3] = larger(high[v % 3], mesh->positions[v]);
    }
    double size = sqrt(distance_squared(low, high));
    for (int i = 0; i < points; i++) {
        double p[3];
        for (int d = 0; d < 3; d++) // a third of them beside the mesh's box
            p[d] = low[d] + (high[d] - low[d]) * (i % 3 ? gen_unit(&random) : 2 * gen_unit(&random) - 0.5);
        check_point(&locator, p, size, wrong);
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v += 7)
        check_point(&locator, mesh->positions + 3 * v, size, wrong);
    CHECK_INT(wrong[0], 0); // found
    CHECK_INT(wrong[1], 0); // walked
    CHECK_INT(wrong[2], 0); // distance
    CHECK_INT(wrong[3], 0); // place
    locator_fini(&locator);
}

static void test_samples(void)
{
    static const struct {
        const char *name;
        uint32_t size;
    } meshes[] = {{"cube", 4}, {"torus", 1}, {"shell", 3}, {"fin", 4}, {"delta", 2}};
    for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
        struct tetmesh mesh = {0};
        REQUIRE(sample_find(meshes[i].name)->make(&mesh, meshes[i].size, NULL) == TETLOD_OK);
        check_mesh(&mesh, 300);
        tetmesh_fini(&mesh);
    }
}

static const double unit[4 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
static const uint32_t one_tet[4] = {0, 1, 2, 3};

static void test_one_tetrahedron(void)
{
    struct locator locator;
    struct place place;
    double weights[4];
    uint32_t tet;
    REQUIRE(locator_init(&locator, unit, 4, one_tet, 1, NULL) == TETLOD_OK);
    CHECK_INT(locator.surface.count, 4);
    CHECK_NEAR(locator_weights(&locator, 0, (double[]){0.1, 0.2, 0.3}, weights), 0.1, 1e-15);
    CHECK_NEAR(weights[0], 0.4, 1e-15);
    CHECK_NEAR(weights[3], 0.3, 1e-15);
    CHECK_INT(locator_find(&locator, (double[]){0.1, 0.2, 0.3}, &tet, 1), 1);
    CHECK_INT(locator_find(&locator, (double[]){0.5, 0.6, 0.3}, &tet, 1), 0);
    CHECK_INT(locator_find(&locator, (double[]){0, 0, 1}, &tet, 1), 1); // a corner
    CHECK_INT(locator_walk(&locator, 0, (double[]){2, 2, 2}, weights), TETLOD_NONE);
    CHECK_NEAR(locator_closest(&locator, (double[]){1, 1, 1}, &place), 2 / sqrt(3), 1e-15);
    CHECK_NEAR(locator_closest(&locator, (double[]){-3, -4, 0}, &place), 5, 1e-14);
    CHECK_NEAR(locator_closest(&locator, (double[]){0.2, 0.2, 0.1}, &place), 0.1, 1e-15);
    locator_fini(&locator);
}

static void test_without_volume(void)
{
    const double flat[4 * 3] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
    struct locator locator;
    double weights[4];
    REQUIRE(locator_init(&locator, flat, 4, one_tet, 1, NULL) == TETLOD_OK);
    CHECK(locator_weights(&locator, 0, (double[]){0.3, 0.3, 0}, weights) == -INFINITY);
    locator_fini(&locator);
}

int main(void)
{
    RUN(test_samples);
    RUN(test_one_tetrahedron);
    RUN(test_without_volume);
    return test_end();
}
