/* SPDX-License-Identifier: BSD-3-Clause */
/* The exact maximum over an overlay: known answers, and never below what dense sampling of any two meshes finds. */
#include <stdlib.h>

#include "src/measure/overlay.h"
#include "src/mesh/locate.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/test.h"

/* A unit cube of n^3 cubes of six tetrahedra each, its inner vertices moved at random, with one field of zeros. */
static int make_cube(struct tetmesh *mesh, uint32_t n, uint64_t seed)
{
    if (sample_find("cube")->make(mesh, n, NULL) != TETLOD_OK)
        return 0;
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++) {
        double x = mesh->positions[i] / n;
        double step = ((double)(gen_random(&seed) >> 11) * 0x1p-53 - 0.5) * 0.3 / n;
        mesh->positions[i] = x > 0 && x < 1 ? x + step : x;
    }
    memset(mesh->fields[0].values, 0, mesh->vertex_count * sizeof(double));
    return 1;
}

static void random_values(struct tetmesh *mesh, uint64_t seed)
{
    for (size_t v = 0; v < mesh->vertex_count; v++)
        mesh->fields[0].values[v] = (double)(gen_random(&seed) >> 11) * 0x1p-53;
}

static double exact(const struct tetmesh *a, const struct tetmesh *b, unsigned threads)
{
    static const uint32_t first[1] = {0};
    double most = -1;
    struct overlay_report report;
    CHECK(overlay_max(a, first, b, first, 1, &(struct overlay_options){.threads = threads}, &most, &report, NULL) == TETLOD_OK);
    return most;
}

/* The same mesh, with values so large that any rounding would show. */
static void test_identity(void)
{
    struct tetmesh mesh;
    REQUIRE(make_cube(&mesh, 5, 1));
    random_values(&mesh, 2);
    for (size_t v = 0; v < mesh.vertex_count; v++)
        mesh.fields[0].values[v] *= 1e30;
    CHECK(exact(&mesh, &mesh, 2) == 0);
    tetmesh_fini(&mesh);
}

/* A linear field is the same on every mesh. */
static void test_linear(void)
{
    struct tetmesh meshes[2];
    REQUIRE(make_cube(&meshes[0], 6, 3) && make_cube(&meshes[1], 4, 4));
    for (int m = 0; m < 2; m++)
        for (size_t v = 0; v < meshes[m].vertex_count; v++) {
            const double *p = meshes[m].positions + 3 * v;
            meshes[m].fields[0].values[v] = 3 * p[0] - 2 * p[1] + p[2] / 2 + 7;
        }
    CHECK_NEAR(exact(&meshes[0], &meshes[1], 2), 0, 1e-13);
    CHECK_NEAR(exact(&meshes[1], &meshes[0], 2), 0, 1e-13);
    tetmesh_fini(&meshes[0]);
    tetmesh_fini(&meshes[1]);
}

/* One vertex of either mesh stands out: the largest difference is there, and nothing of the other mesh is near it. */
static void test_tent(void)
{
    struct tetmesh meshes[2];
    for (int m = 0; m < 2; m++) {
        REQUIRE(make_cube(&meshes[0], 5, 5) && make_cube(&meshes[1], 3, 6));
        struct tetmesh *mesh = &meshes[m];
        mesh->fields[0].values[mesh->vertex_count / 2] = m ? -0.75 : 0.75;
        CHECK_NEAR(exact(&meshes[0], &meshes[1], 1), 0.75, 1e-14);
        tetmesh_fini(&meshes[0]);
        tetmesh_fini(&meshes[1]);
    }
}

static int make_mesh(struct tetmesh *mesh, const double (*points)[3], uint32_t vertices, const uint32_t (*corners)[4],
                     uint32_t tets)
{
    *mesh = (struct tetmesh){.vertex_count = vertices, .tet_count = tets, .position_type = TETLOD_FLOAT64};
    mesh->positions = malloc(vertices * 24ul);
    mesh->corners = malloc(tets * 16ul);
    if (!mesh->positions || !mesh->corners || tetmesh_add_field(mesh, "f", 1, TETLOD_FLOAT64, NULL) != TETLOD_OK)
        return 0;
    memcpy(mesh->positions, points, vertices * 24ul);
    memcpy(mesh->corners, corners, tets * 16ul);
    return 1;
}

/* An edge of the one against a face of the other is where no vertex of either is: the square's diagonals cross at its middle, and
 * the two ways to cut the prism under it differ there by one. */
static void test_crossing_edges(void)
{
    static const double points[5][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}};
    static const uint32_t one[2][4] = {{0, 1, 2, 4}, {0, 2, 3, 4}}, other[2][4] = {{0, 1, 3, 4}, {1, 2, 3, 4}};
    struct tetmesh meshes[2];
    REQUIRE(make_mesh(&meshes[0], points, 5, one, 2) && make_mesh(&meshes[1], points, 5, other, 2));
    for (int m = 0; m < 2; m++) {
        meshes[m].fields[0].values[0] = meshes[m].fields[0].values[2] = 1;
        CHECK(exact(&meshes[m], &meshes[m], 1) == 0);
    }
    CHECK_NEAR(exact(&meshes[0], &meshes[1], 1), 1, 1e-15);
    tetmesh_fini(&meshes[0]);
    tetmesh_fini(&meshes[1]);
}

/* Two tetrahedra back to back that share no vertex: the field jumps across their face, and each side is compared with its own.
 * A flat one between them carries nothing. */
static void test_jump(void)
{
    static const double points[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.2, 0.2, 1},
                                        {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.2, 0.2, -1}};
    static const uint32_t corners[3][4] = {{0, 1, 2, 3}, {4, 6, 5, 7}, {0, 1, 2, 4}};
    static const uint32_t only[1] = {0};
    struct tetmesh mesh, other;
    struct overlay_report report;
    double most;
    REQUIRE(make_mesh(&mesh, points, 8, corners, 3) && make_mesh(&other, points, 8, corners, 3));
    for (int v = 4; v < 8; v++) {
        mesh.fields[0].values[v] = 5;
        other.fields[0].values[v] = 6;
    }
    CHECK(exact(&mesh, &mesh, 1) == 0);
    REQUIRE(overlay_max(&mesh, only, &other, only, 1, &(struct overlay_options){.threads = 1}, &most, &report, NULL) == TETLOD_OK);
    CHECK(most == 1);
    CHECK_INT(report.cells, 1); // the other pair is equal
    CHECK_INT(report.degenerate[0], 1);
    CHECK_INT(report.degenerate[1], 1);
    tetmesh_fini(&mesh);
    tetmesh_fini(&other);
}

/* Two tetrahedra with a face each in one plane, of which rounding says now this, now that: what they have in common is the same
 * whichever corner is the first. */
static void test_common_plane(void)
{
    static const double x = 0.031948491930961609, y = -0.0032258168794214725;
    const double points[8][3] = {{0.02129899337887764, 0, 0.75}, {x, 0, 1}, {x, -0.30000001192092896, 0.67500001192092896}, {x, 1, 1},
                                 {x, y, 0.75870847702026367}, {0.021642526611685753, y, 0.48294669389724731},
                                 {x, 1.0354838371276855, 0.75870847702026367}, {x, y, 0.48294669389724731}};
    double first = 0;
    for (int order = 0; order < 24 * 24; order++) {
        struct tetmesh meshes[2];
        for (int m = 0; m < 2; m++) {
            uint32_t left[4] = {0, 1, 2, 3}, corners[1][4];
            for (int k = 0, code = m ? order / 24 : order % 24; k < 4; code /= 4 - k, k++) {
                int taken = code % (4 - k);
                corners[0][k] = left[taken];
                memmove(left + taken, left + taken + 1, sizeof *left * (size_t)(3 - taken));
            }
            REQUIRE(make_mesh(&meshes[m], points + 4 * m, 4, corners, 1));
            for (int v = 0; v < 4; v++)
                meshes[m].fields[0].values[v] = m ? 0 : points[v][2];
        }
        double most = exact(&meshes[0], &meshes[1], 1);
        first = order ? first : most;
        CHECK_NEAR(most, first, 1e-15);
        tetmesh_fini(&meshes[0]);
        tetmesh_fini(&meshes[1]);
    }
    CHECK_NEAR(first, 0.75870847702026367, 1e-15);
}

/* A mesh that covers its domain twice, with different values, is itself; and a single sheet is compared with the nearer. */
static void test_overlap(void)
{
    static const double points[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                        {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    static const uint32_t corners[2][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}};
    struct tetmesh twice, once;
    REQUIRE(make_mesh(&twice, points, 8, corners, 2) && make_mesh(&once, points, 4, corners, 1));
    for (int v = 0; v < 8; v++)
        twice.fields[0].values[v] = v < 4 ? 1 : 4;
    for (int v = 0; v < 4; v++)
        once.fields[0].values[v] = 2;
    CHECK(exact(&twice, &twice, 1) == 0);
    CHECK_NEAR(exact(&once, &twice, 1), 1, 1e-15);
    CHECK_NEAR(exact(&twice, &once, 1), 2, 1e-15);
    tetmesh_fini(&twice);
    tetmesh_fini(&once);
}

static double value_at(const struct locator *locator, const struct tetmesh *mesh, const double p[3])
{
    uint32_t tet;
    double weights[4], sum = 0;
    if (!locator_find(locator, p, &tet, 1))
        return NAN;
    locator_weights(locator, tet, p, weights);
    for (int c = 0; c < 4; c++)
        sum += weights[c] * mesh->fields[0].values[mesh->corners[4 * (size_t)tet + (size_t)c]];
    return sum;
}

/* The largest difference at random points, sharpened by going on around the best. */
static double dense(const struct tetmesh *a, const struct tetmesh *b, uint64_t seed)
{
    struct locator locators[2];
    double best = 0, at[3] = {0.5, 0.5, 0.5}, p[3];
    if (locator_init(&locators[0], a->positions, a->vertex_count, a->corners, a->tet_count, NULL) != TETLOD_OK ||
        locator_init(&locators[1], b->positions, b->vertex_count, b->corners, b->tet_count, NULL) != TETLOD_OK)
        return NAN;
    for (int i = 0; i < 40000; i++) {
        double reach = i < 20000 ? 1 : pow(2, -(i - 20000) / 1000.0);
        for (int d = 0; d < 3; d++) {
            double x = (double)(gen_random(&seed) >> 11) * 0x1p-53;
            p[d] = fmin(1, fmax(0, i < 20000 ? x : at[d] + reach * (x - 0.5)));
        }
        double found = fabs(value_at(&locators[0], a, p) - value_at(&locators[1], b, p));
        if (found > best) {
            best = found;
            memcpy(at, p, sizeof at);
        }
    }
    locator_fini(&locators[0]);
    locator_fini(&locators[1]);
    return best;
}

static void test_against_sampling(void)
{
    for (uint64_t seed = 1; seed <= 6; seed++) {
        struct tetmesh a, b;
        REQUIRE(make_cube(&a, 2, seed) && make_cube(&b, 1 + seed % 3, seed + 50));
        random_values(&a, seed + 100);
        random_values(&b, seed + 200);
        double sampled = dense(&a, &b, seed), most = exact(&a, &b, 1);
        CHECK(sampled <= most * (1 + 1e-9));
        CHECK(sampled >= most * 0.97);
        CHECK_NEAR(exact(&b, &a, 1), most, 1e-12); // of the same domain, either way round
        CHECK(exact(&a, &b, 3) == most);           // whatever the threads
        tetmesh_fini(&a);
        tetmesh_fini(&b);
    }
}

int main(void)
{
    RUN(test_identity);
    RUN(test_linear);
    RUN(test_tent);
    RUN(test_crossing_edges);
    RUN(test_jump);
    RUN(test_common_plane);
    RUN(test_overlap);
    RUN(test_against_sampling);
    return test_end();
}
