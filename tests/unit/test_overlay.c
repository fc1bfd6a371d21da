/* SPDX-License-Identifier: BSD-3-Clause */
/* The exact maximum over an overlay: known answers, and never below what dense sampling of any two meshes finds. */
#include <stdlib.h>

#include "src/measure/exact_cell.h"
#include "src/measure/overlay.h"
#include "src/measure/overlay_levels.h"
#include "src/mesh/locate.h"
#include "src/mesh/tet_geom.h"
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
        double step = (gen_unit(&seed) - 0.5) * 0.3 / n;
        mesh->positions[i] = x > 0 && x < 1 ? x + step : x;
    }
    memset(mesh->fields[0].values, 0, mesh->vertex_count * sizeof(double));
    return 1;
}

static void random_values(struct tetmesh *mesh, uint64_t seed)
{
    for (size_t v = 0; v < mesh->vertex_count; v++)
        mesh->fields[0].values[v] = gen_unit(&seed);
}

static double exact(const struct tetmesh *a, const struct tetmesh *b, unsigned threads)
{
    static const uint32_t first[1] = {0};
    double most = -1;
    struct overlay_report report;
    CHECK(overlay_max(a, first, b, first, 1, &(struct overlay_options){.threads = threads}, &most, &report,
                      NULL) == TETLOD_OK);
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

/* An edge of the one against a face of the other is where no vertex of either is: the square's diagonals cross at its
 * middle, and the two ways to cut the prism under it differ there by one. */
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

/* Two tetrahedra back to back that share no vertex: the field jumps across their face, and each side is compared with
 * its own. A flat one between them carries nothing. */
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
    REQUIRE(overlay_max(&mesh, only, &other, only, 1, &(struct overlay_options){.threads = 1}, &most, &report,
                        NULL) == TETLOD_OK);
    CHECK(most == 1);
    CHECK_INT(report.cells, 1); // the other pair is equal
    CHECK_INT(report.degenerate[0], 1);
    CHECK_INT(report.degenerate[1], 1);
    tetmesh_fini(&mesh);
    tetmesh_fini(&other);
}

/* Two tetrahedra with a face each in one plane, of which rounding says now this, now that: what they have in common is
 * the same whichever corner is the first. */
static void test_common_plane(void)
{
    static const double x = 0.031948491930961609, y = -0.0032258168794214725;
    const double points[8][3] = {{0.02129899337887764, 0, 0.75}, {x, 0, 1},
                                 {x, -0.30000001192092896, 0.67500001192092896}, {x, 1, 1},
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

/* A mesh that covers its domain twice, with different values, is itself; and a single sheet is compared with the
 * nearer. */
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
            double x = gen_unit(&seed);
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

/* The same, of all pairs in 113 bits: nothing is ruled out. */
static double all_pairs(const struct tetmesh *a, const struct tetmesh *b)
{
    const struct tetmesh *const meshes[2] = {a, b};
    quad most = 0;
    for (size_t pair = 0; pair < (size_t)a->tet_count * b->tet_count; pair++) {
        const size_t tets[2] = {pair / b->tet_count, pair % b->tet_count};
        struct exact_cell cell;
        double values[2][4];
        for (int m = 0; m < 2; m++)
            for (size_t c = 0; c < 4; c++) {
                size_t v = meshes[m]->corners[4 * tets[m] + c];
                cell.corners[m][c] = meshes[m]->positions + 3 * v;
                values[m][c] = meshes[m]->fields[0].values[v];
            }
        bool meet = exact_cell_clip(&cell);
        for (int end = 0; meet && end < cell.count; end++) {
            quad found = exact_cell_difference(&cell, end, (const double(*)[4])values);
            most = found > most ? found : most;
        }
    }
    return (double)most;
}

/* Flattened across no axis: what rounding makes of weights then grows as the thickness falls. */
static void flatten(struct tetmesh *mesh, double thickness)
{
    static const double normal[3] = {0.36, 0.48, 0.8};
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        double *p = mesh->positions + 3 * v, height = p[0] * normal[0] + p[1] * normal[1] + p[2] * normal[2];
        for (int d = 0; d < 3; d++)
            p[d] += (thickness - 1) * height * normal[d];
    }
}

/* What rules pairs out, or whole boxes of them, rules out nothing that counts: fields that differ most in one place,
 * and ones that do nearly as much everywhere; tetrahedra of all shapes. */
static void test_against_all_pairs(void)
{
    static const double thicknesses[4] = {1, 1e-2, 1e-6, 1e-8};
    for (uint64_t seed = 1; seed <= 24; seed++) {
        struct tetmesh a, b;
        REQUIRE(make_cube(&a, 1 + seed % 3, seed) && make_cube(&b, 1 + seed / 3 % 3, seed + 50));
        random_values(&a, seed + 100);
        random_values(&b, seed + 200);
        for (size_t v = 0; v < a.vertex_count && seed % 2; v++) // as good as flat but for one vertex
            a.fields[0].values[v] *= v == seed % a.vertex_count ? 1 : 1e-3;
        flatten(&a, thicknesses[(seed - 1) / 6]);
        flatten(&b, thicknesses[(seed - 1) / 6]);
        double wanted = all_pairs(&a, &b);
        CHECK(wanted > 0);
        CHECK_NEAR(exact(&a, &b, 2), wanted, 1e-14 * wanted);
        tetmesh_fini(&a);
        tetmesh_fini(&b);
    }
}

static double between(uint64_t *seed, double low, double high)
{
    return low + (high - low) * gen_unit(seed);
}

/* A tetrahedron of a height, across no axis. */
static void make_first(double p[4][3], double height, uint64_t *seed)
{
    static const double along[2][3] = {{0.8, -0.6, 0}, {0.48, 0.64, -0.6}}, normal[3] = {0.36, 0.48, 0.8},
                        place[4][2] = {{0, 0}, {1, 0}, {0, 1}, {0.3, 0.4}};
    for (int c = 0; c < 4; c++) {
        double x = place[c][0] + between(seed, 0, 0.2), y = place[c][1] + between(seed, 0, 0.2);
        for (int d = 0; d < 3; d++)
            p[c][d] = x * along[0][d] + y * along[1][d] + (c == 3 ? height : 0) * normal[d];
    }
}

enum { CROSSES, TOUCHES, LIES_ON, KINDS };

/* One that crosses it, or lies with a face on one of its, by about what is a contact, or has a corner there, at 0, and
 * short edges along the axes. */
static void make_second(double p[4][3], double first[4][3], int kind, uint64_t *seed)
{
    for (int c = 0; c < 4; c++) {
        double w[4] = {between(seed, -0.2, 0.6), between(seed, -0.2, 0.6), 0,
                       kind == CROSSES ? between(seed, -0.2, 0.6) : between(seed, 0, 2e-8)};
        w[3] = kind == LIES_ON && c == 3 ? -0.5 : w[3];
        w[2] = 1 - w[0] - w[1] - w[3];
        for (int d = 0; d < 3; d++)
            p[c][d] = w[0] * first[0][d] + w[1] * first[1][d] + w[2] * first[2][d] + w[3] * first[3][d];
    }
    for (int i = 0; i < 12 && kind == TOUCHES; i++)
        first[i / 3][i % 3] -= p[0][i % 3];
    for (int i = 0; i < 12 && kind == TOUCHES; i++)
        p[i / 3][i % 3] = i / 3 == i % 3 + 1 ? -1e-9 : 0;
}

static bool is_degenerate(double p[4][3])
{
    return tet_orientation(p[0], p[1], p[2], p[3]) == 0;
}

/* Rounding, which for slivers and for small ones beside large ones is far more than what makes a contact, must not rule
 * a pair out. The floor is a hair below the difference. */
static void test_rounding(void)
{
    static const uint32_t corners[1][4] = {{0, 1, 2, 3}}, only[1] = {0};
    static const double heights[4] = {0.5, 1e-7, 3e-8, 5e-9};
    uint64_t seed = 7;
    for (int i = 0; i < 4800; i++) {
        double p[2][4][3], floor, most;
        struct tetmesh meshes[2];
        struct overlay_report report;
        make_first(p[1], heights[i % 4], &seed);
        make_second(p[0], p[1], i % KINDS, &seed);
        for (int m = 0; m < 2; m++) {
            REQUIRE(make_mesh(&meshes[m], p[m], 4, corners, 1));
            random_values(&meshes[m], gen_random(&seed));
        }
        double wanted = all_pairs(&meshes[0], &meshes[1]);
        if (is_degenerate(p[0]) || is_degenerate(p[1]))
            wanted = 0;
        floor = wanted * (1 - 1e-12);
        REQUIRE(overlay_max(&meshes[0], only, &meshes[1], only, 1,
                            &(struct overlay_options){.threads = 1, .floors = &floor}, &most, &report,
                            NULL) == TETLOD_OK);
        CHECK(most == wanted);
        tetmesh_fini(&meshes[0]);
        tetmesh_fini(&meshes[1]);
    }
}

/* What the finest level of a mesh, as `coarsening` has it, is found to differ by near its boundary. */
static double finest_within(const struct tetmesh *original, struct coarsening *coarsening, double reach)
{
    struct overlay_levels *levels;
    double most = 0;
    if (overlay_levels_new(&levels, original, coarsening, 1, NULL) != TETLOD_OK)
        return NAN;
    CHECK(overlay_levels_next(levels, coarsening, reach, &most, NULL) == TETLOD_OK);
    overlay_levels_free(levels);
    return most;
}

static double finest(const struct tetmesh *original, struct coarsening *coarsening)
{
    return finest_within(original, coarsening, INFINITY);
}

/* The vertex that is nearest to a point. */
static uint32_t vertex_at(const struct tetmesh *mesh, double x, double y, double z)
{
    uint32_t best = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        if (distance_squared(mesh->positions + 3 * (size_t)v, (const double[3]){x, y, z}) <
            distance_squared(mesh->positions + 3 * (size_t)best, (const double[3]){x, y, z}))
            best = v;
    return best;
}

/* Near the boundary all differences are found, far inside none is looked for. */
static void test_near_boundary(void)
{
    struct tetmesh mesh;
    struct coarsening level;
    REQUIRE(sample_find("cube")->make(&mesh, 8, NULL) == TETLOD_OK);
    REQUIRE(coarsening_init(&level, &mesh, NULL, NULL) == TETLOD_OK);
    level.fields[0].values[vertex_at(&mesh, 4, 4, 4)] += 0.5;
    CHECK(finest_within(&mesh, &level, 0) == 0);
    CHECK(finest_within(&mesh, &level, 0.16) == 0);
    CHECK(finest_within(&mesh, &level, 2.9) == 0); // its tetrahedra end 3 from the boundary
    CHECK_NEAR(finest_within(&mesh, &level, 3.1), 0.5, 1e-12);
    level.fields[0].values[vertex_at(&mesh, 4, 4, 8)] += 0.25;
    level.fields[0].values[vertex_at(&mesh, 4, 4, 6)] += 0.375;
    CHECK(finest_within(&mesh, &level, 0.16) >= 0.25 - 1e-12);
    CHECK_NEAR(finest_within(&mesh, &level, 1.5), 0.375, 1e-12);
    CHECK_NEAR(finest(&mesh, &level), 0.5, 1e-12);
    coarsening_fini(&level);
    tetmesh_fini(&mesh);
}

/* Two bodies at one place: each is compared with itself, though the other one has its values. */
static void test_bodies(void)
{
    static const double points[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                        {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    static const uint32_t tets[2][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}}, bodies[8] = {0, 0, 0, 0, 1, 1, 1, 1};
    static const uint32_t only[1] = {0};
    struct tetmesh meshes[2];
    struct overlay_report report;
    struct overlay_options options = {.threads = 1};
    double most;
    for (int m = 0; m < 2; m++) {
        REQUIRE(make_mesh(&meshes[m], points, 8, tets, 2));
        for (int i = 0; i < 4; i++)
            meshes[m].fields[0].values[4 * m + i] = 1;
    }
    REQUIRE(overlay_max(&meshes[0], only, &meshes[1], only, 1, &options, &most, &report, NULL) == TETLOD_OK);
    CHECK(most == 0);
    options.bodies[0] = options.bodies[1] = bodies;
    REQUIRE(overlay_max(&meshes[0], only, &meshes[1], only, 1, &options, &most, &report, NULL) == TETLOD_OK);
    CHECK(most == 1);
    tetmesh_fini(&meshes[0]);
    tetmesh_fini(&meshes[1]);
}

/* A finest level that is the original has no difference; one with a position, a value or a diagonal of its own has. */
static void test_finest_level(void)
{
    static const double points[5][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}};
    static const uint32_t one[2][4] = {{0, 1, 2, 4}, {0, 2, 3, 4}}, other[2][4] = {{0, 1, 3, 4}, {1, 2, 3, 4}};
    struct tetmesh mesh, turned;
    struct coarsening same, crossed;
    REQUIRE(make_mesh(&mesh, points, 5, one, 2) && make_mesh(&turned, points, 5, other, 2));
    mesh.fields[0].values[2] = turned.fields[0].values[2] = 1;
    REQUIRE(coarsening_init(&same, &mesh, NULL, NULL) == TETLOD_OK &&
            coarsening_init(&crossed, &turned, NULL, NULL) == TETLOD_OK);
    CHECK(finest(&mesh, &same) == 0);
    CHECK_NEAR(finest(&mesh, &crossed), 0.5, 1e-15);
    same.fields[0].values[4] += 0.25;
    CHECK(finest(&mesh, &same) == 0.25);
    same.fields[0].values[4] -= 0.25;
    same.positions[3 * 4 + 2] = 2;
    mesh.fields[0].values[4] = same.fields[0].values[4] = 1;
    CHECK_NEAR(finest(&mesh, &same), 0.25, 1e-15);
    coarsening_fini(&same);
    coarsening_fini(&crossed);
    tetmesh_fini(&mesh);
    tetmesh_fini(&turned);
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
    RUN(test_bodies);
    RUN(test_against_sampling);
    RUN(test_against_all_pairs);
    RUN(test_rounding);
    RUN(test_finest_level);
    RUN(test_near_boundary);
    return test_end();
}
