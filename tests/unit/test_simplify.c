/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Contraction sequences of small meshes: every level is a sound mesh of the same domain, certified errors are upper
 * bounds, and the sequence does not depend on the number of threads.
 */
#include "src/simplify/simplify.h"

#include <stdlib.h>

#include "tests/ancestry.h"
#include "src/measure/measure.h"
#include "src/mesh/adjacency.h"
#include "src/mesh/locate.h"
#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "src/sample/sample.h"
#include "tests/gen.h"
#include "tests/test.h"

enum { POINTS = SANITIZED ? 500 : 20000 };

static struct simplify_options usual(const struct tetmesh *mesh)
{
    return (struct simplify_options){.metric = METRIC_ENVELOPE,
                                     .contract = CONTRACT_EDGES,
                                     .max_error = 1,
                                     .min_tets = 1,
                                     .boundary_angle = 0.01,
                                     .boundary_limit = 1e-6 * mesh_diagonal(mesh),
                                     .growth = 1.2,
                                     .threads = 2};
}

static struct mesh_report look(const struct tetmesh *mesh)
{
    struct mesh_report report = {0};
    CHECK_INT(mesh_check(mesh->positions, mesh->corners, mesh->vertex_count, mesh->tet_count, &report, NULL),
              TETLOD_OK);
    return report;
}

/* Grid cubes whose inner vertices are moved at random, as float64, with a field that bends. */
static void make_jittered(struct tetmesh *mesh, uint32_t size, uint64_t seed)
{
    REQUIRE(sample_find("cube")->make(mesh, size, NULL) == TETLOD_OK);
    mesh->position_type = mesh->fields[0].type = TETLOD_FLOAT64;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        double *p = mesh->positions + 3 * v, sum = 0;
        for (int d = 0; d < 3; d++) {
            if (p[d] > 0 && p[d] < size) // what lies in a side stays in it
                p[d] += 0.3 * (gen_unit(&seed) - 0.5);
            sum += (d + 1) * p[d] / size;
        }
        mesh->fields[0].values[v] = sin(2 * sum) + 0.01 * gen_unit(&seed);
    }
    CHECK_INT(look(mesh).inverted_tets + look(mesh).degenerate_tets, 0);
}

/* Value of field 0 at a place. */
static double value_at(const struct tetmesh *mesh, const uint32_t *vertices, const double *weights)
{
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += weights[i] * mesh->fields[0].values[vertices[i]];
    return sum;
}

/* The largest difference of field 0 at random points of the original, and that of the nearest of the level. */
static double true_error(const struct tetmesh *original, const struct tetmesh *level)
{
    struct locator locator;
    uint64_t random = 77;
    double worst = 0;
    if (locator_init(&locator, level->positions, level->vertex_count, level->corners, level->tet_count,
                     NULL) != TETLOD_OK)
        return INFINITY;
    for (int i = 0; i < POINTS; i++) {
        const uint32_t *corners = original->corners + 4 * (gen_random(&random) % original->tet_count);
        double weights[4], total = 0, p[3] = {0, 0, 0};
        if (!tet_orientation(original->positions + 3 * corners[0], original->positions + 3 * corners[1],
                             original->positions + 3 * corners[2], original->positions + 3 * corners[3]))
            continue; // no promise is made inside
        for (int c = 0; c < 4; c++)
            total += weights[c] = gen_unit(&random) * (i % 3 ? 1 : gen_unit(&random)) + 1e-12;
        for (int c = 0; c < 4; c++) {
            weights[c] /= total;
            for (int d = 0; d < 3; d++)
                p[d] += weights[c] * original->positions[3 * corners[c] + d];
        }
        uint32_t tet;
        struct place place;
        if (locator_find(&locator, p, &tet, 1)) {
            locator_weights(&locator, tet, p, place.weights);
            memcpy(place.vertices, level->corners + 4 * tet, sizeof place.vertices);
        } else
            locator_closest(&locator, p, &place);
        worst = larger(worst, fabs(value_at(original, corners, weights) - value_at(level, place.vertices,
                                                                                   place.weights)));
    }
    locator_fini(&locator);
    return worst;
}

/* The largest distance of a random point of one mesh's boundary from the other's. */
static double boundary_distance(const struct tetmesh *from, const struct tetmesh *to)
{
    struct locator locators[2];
    const struct tetmesh *meshes[2] = {from, to};
    uint64_t random = 5;
    double worst = 0;
    for (int i = 0; i < 2; i++)
        if (locator_init(&locators[i], meshes[i]->positions, meshes[i]->vertex_count, meshes[i]->corners,
                         meshes[i]->tet_count, NULL) != TETLOD_OK)
            return INFINITY;
    for (int i = 0; i < POINTS; i++) {
        const uint32_t *corners = locators[0].surface.triangles + 3 * (gen_random(&random) % locators[0].surface.count);
        double u = gen_unit(&random), v = gen_unit(&random), p[3];
        struct place place;
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        for (int d = 0; d < 3; d++)
            p[d] = (1 - u - v) * from->positions[3 * corners[0] + d] + u * from->positions[3 * corners[1] + d] +
                   v * from->positions[3 * corners[2] + d];
        worst = larger(worst, locator_closest(&locators[1], p, &place));
    }
    for (int i = 0; i < 2; i++)
        locator_fini(&locators[i]);
    return worst;
}

/* `moved`: how far the boundary may be from the original's. */
static void check_level(const struct tetmesh *original, const struct mesh_report *start, const struct tetmesh *level,
                        double moved)
{
    struct mesh_report now = look(level);
    CHECK_INT(now.unused_vertices, 0);
    CHECK_INT(now.orientation, start->orientation);
    CHECK(now.degenerate_tets <= start->degenerate_tets);
    CHECK_INT(now.inverted_tets, start->inverted_tets);
    CHECK_INT(now.duplicate_tets, 0);
    CHECK_INT(now.overfull_faces, 0);
    CHECK_INT(now.same_side_faces, 0);
    CHECK_INT(now.singular_vertices, start->singular_vertices);
    CHECK_INT(now.euler, start->euler);
    CHECK_INT(now.components, start->components);
    CHECK_INT(now.boundary_components, start->boundary_components);
    CHECK_NEAR(now.volume, start->volume, 1e-9 * start->volume + moved * start->boundary_area);
    if (moved < 1e-9 * mesh_diagonal(original))
        CHECK_NEAR(now.boundary_area, start->boundary_area, 1e-7 * start->boundary_area);
    CHECK_INT(level->field_count, original->field_count);
    for (uint32_t f = 0; f < level->field_count; f++) { // values stay in the original's range
        double range[2], now_range[2];
        point_field_range(&original->fields[f], original->vertex_count, range);
        point_field_range(&level->fields[f], level->vertex_count, now_range);
        CHECK(now_range[0] >= range[0] && now_range[1] <= range[1]);
    }
}

/* Neighbours that are passed on from level to level are those of the level's faces. */
static void check_neighbours(const struct ancestry_level *level)
{
    size_t slots = 4 * (size_t)level->mesh.tet_count;
    uint32_t *built = malloc(slots * sizeof *built);
    REQUIRE(built);
    CHECK_INT(adjacency_build(level->mesh.corners, level->mesh.tet_count, level->mesh.vertex_count, built, NULL, NULL),
              TETLOD_OK);
    CHECK(memcmp(built, level->neighbours, slots * sizeof *built) == 0);
    free(built);
}

/* Tetrahedra at the end. */
static uint32_t left(const struct contraction_log *log)
{
    return log->marks[log->mark_count - 1].tets;
}

/* Has no contraction taken the node? */
static bool alive(const struct contraction_log *log, uint32_t node)
{
    for (size_t i = 0; i < 4 * (size_t)log->count; i++)
        if (log->children[i] == node)
            return false;
    return true;
}

/* Simplifies by the first field and checks every mark. `most`: no more tetrahedra may be left at the end. */
static void check_sequence(const struct tetmesh *mesh, const struct simplify_options *options, uint32_t most)
{
    struct contraction_log s;
    struct ancestry ancestry;
    struct mesh_report start = look(mesh);
    double range[2];
    REQUIRE(simplify(&s, mesh, (uint32_t[]){0}, 1, NULL, options, NULL) == TETLOD_OK);
    REQUIRE(ancestry_init(&ancestry, &s, mesh, NULL) == TETLOD_OK);
    point_field_range(&mesh->fields[0], mesh->vertex_count, range);
    CHECK_INT(s.marks[0].contractions, 0);
    CHECK_INT(s.marks[s.mark_count - 1].contractions, s.count);
    if (left(&s) > most)
        TEST_FAIL("%u tetrahedra are left, not at most %u", left(&s), most);
    for (uint32_t m = 0; m < s.mark_count; m++) {
        struct ancestry_level level;
        REQUIRE(ancestry_level(&ancestry, s.marks[m].contractions, &level, NULL) == TETLOD_OK);
        CHECK_INT(level.mesh.vertex_count, s.marks[m].vertices);
        CHECK_INT(level.mesh.tet_count, s.marks[m].tets);
        check_level(mesh, &start, &level.mesh, s.marks[m].moved);
        check_neighbours(&level);
        CHECK(s.marks[m].moved <= options->boundary_limit && (!m || s.marks[m].moved >= s.marks[m - 1].moved));
        CHECK(!m || s.certified[m] >= s.certified[m - 1]);
        CHECK(!m || s.predicted[m] >= s.predicted[m - 1]);
        if (options->metric == METRIC_ENVELOPE || options->certify == CERTIFY_EXACT)
            CHECK(s.certified[m] <= options->max_error * (1 + 1e-9));
        if (m % 3 == 2 || m + 1 == s.mark_count) {
            double error = true_error(mesh, &level.mesh) / (range[1] - range[0]);
            if (!(error <= s.certified[m] * (1 + 1e-6) + 1e-7))
                TEST_FAIL("mark %u: error %g, certified %g", m, error, s.certified[m]);
            double far = s.marks[m].moved * (1 + 1e-9) + 1e-12 * mesh_diagonal(mesh);
            CHECK(boundary_distance(mesh, &level.mesh) <= far && boundary_distance(&level.mesh, mesh) <= far);
        }
        ancestry_level_fini(&level);
    }
    ancestry_fini(&ancestry);
    log_fini(&s);
}

static void check_sample(const char *name, uint32_t size, enum metric metric, unsigned contract, uint32_t most)
{
    struct tetmesh mesh = {0};
    REQUIRE(sample_find(name)->make(&mesh, size, NULL) == TETLOD_OK);
    struct simplify_options options = usual(&mesh);
    options.metric = metric;
    options.contract = contract;
    printf("# %s %u\n", name, size);
    check_sequence(&mesh, &options, most);
    tetmesh_fini(&mesh);
}

static void test_samples_by_envelope(void)
{
    check_sample("cube", 6, METRIC_ENVELOPE, CONTRACT_EDGES, 60);
    check_sample("fin", 5, METRIC_ENVELOPE, CONTRACT_EDGES, 500);
    check_sample("torus", 3, METRIC_ENVELOPE, CONTRACT_EDGES, 2000);
    check_sample("shell", 4, METRIC_ENVELOPE, CONTRACT_EDGES, 2000);
    check_sample("delta", 3, METRIC_ENVELOPE, CONTRACT_EDGES, 2000);
}

/* Where the boundary may move, curved boundary is simplified, too, and nothing else changes. */
static void test_curved_boundary(void)
{
    static const struct {
        const char *name;
        uint32_t size, most;
        double limit;
    } cases[] = {{"torus", 5, 700, 0.01}, {"shell", 5, 650, 0.01}, {"fin", 6, 80, 0.002},
                 {"delta", 4, 30, 0.005}}; // delta: 6 to 28 by ties
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct tetmesh mesh = {0};
        REQUIRE(sample_find(cases[i].name)->make(&mesh, cases[i].size, NULL) == TETLOD_OK);
        struct simplify_options options = usual(&mesh);
        options.boundary_angle = 30;
        options.boundary_limit = cases[i].limit * mesh_diagonal(&mesh);
        options.contract = i == 1 ? CONTRACT_EDGES | CONTRACT_FACES | CONTRACT_TETS : CONTRACT_EDGES;
        printf("# %s %u, boundary moves\n", cases[i].name, cases[i].size);
        check_sequence(&mesh, &options, cases[i].most);
        tetmesh_fini(&mesh);
    }
}

/* A vertex drawn to its neighbour, with another value: the tetrahedra between have no volume, and stay until the two
 * may become one within the limit. Then all around is contracted as elsewhere. */
static void test_coincident_vertices(void)
{
    enum { SIZE = 5, ROW = SIZE + 1, INNER = 2 + 2 * ROW + 2 * ROW * ROW, NEXT = INNER + 1, OUTER = 2 + 2 * ROW };
    for (int i = 0; i < 2; i++) {
        struct tetmesh mesh = {0};
        struct contraction_log s;
        REQUIRE(sample_find("cube")->make(&mesh, SIZE, NULL) == TETLOD_OK);
        const uint32_t pair[2] = {i ? OUTER : INNER, (i ? OUTER : INNER) + NEXT - INNER};
        memcpy(mesh.positions + 3 * pair[1], mesh.positions + 3 * pair[0], 3 * sizeof(double));
        mesh.fields[0].values[pair[1]] = mesh.fields[0].values[pair[0]] + 0.1 * SIZE * SIZE * SIZE;
        uint32_t degenerate = look(&mesh).degenerate_tets;
        CHECK(degenerate > 0 && look(&mesh).inverted_tets == 0);
        struct simplify_options options = usual(&mesh);
        options.max_error = 0.04; // the jump is a tenth of the range: its middle is 0.05 away
        REQUIRE(simplify(&s, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
        CHECK(alive(&s, pair[0]) && alive(&s, pair[1]));
        log_fini(&s);
        options.max_error = 0.06;
        REQUIRE(simplify(&s, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
        CHECK(!alive(&s, pair[0]) || !alive(&s, pair[1]));
        log_fini(&s);
        options.max_error = 1;
        check_sequence(&mesh, &options, 60);
        tetmesh_fini(&mesh);
    }
}

static void test_samples_by_prediction(void)
{
    check_sample("cube", 5, METRIC_SVA, CONTRACT_EDGES, 100);
    check_sample("fin", 5, METRIC_SVA, CONTRACT_EDGES, 500);
    check_sample("delta", 3, METRIC_SVA, CONTRACT_EDGES, 2000);
}

/* By the exact limit: checked the same way, and no more is left than the envelope leaves. */
static void check_exact(const char *name, uint32_t size, enum metric metric, unsigned contract, double max_error)
{
    struct tetmesh mesh = {0};
    struct contraction_log s[2];
    REQUIRE(sample_find(name)->make(&mesh, size, NULL) == TETLOD_OK);
    struct simplify_options options = usual(&mesh);
    options.metric = metric;
    options.contract = contract;
    options.max_error = max_error;
    printf("# %s %u exactly\n", name, size);
    for (int i = 0; i < 2; i++) {
        options.certify = i ? CERTIFY_EXACT : CERTIFY_FAST;
        REQUIRE(simplify(&s[i], &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    }
    if (left(&s[1]) >= left(&s[0]))
        TEST_FAIL("%u tetrahedra are left, not fewer than %u", left(&s[1]), left(&s[0]));
    check_sequence(&mesh, &options, mesh.tet_count - 1);
    for (int i = 0; i < 2; i++)
        log_fini(&s[i]);
    tetmesh_fini(&mesh);
}

static void test_samples_exactly(void)
{
    check_exact("cube", 5, METRIC_FIELD_QUADRIC, CONTRACT_EDGES, 0.05);
    check_exact("cube", 3, METRIC_ENVELOPE, CONTRACT_EDGES | CONTRACT_FACES | CONTRACT_TETS, 0.1);
    check_exact("fin", 5, METRIC_FIELD_QUADRIC, CONTRACT_EDGES, 0.05);
    check_exact("torus", 4, METRIC_QUADRIC, CONTRACT_EDGES, 0.05);
    check_exact("delta", 2, METRIC_FIELD_QUADRIC, CONTRACT_EDGES, 0.02);
}

static void test_samples_by_measured_error(void)
{
    check_sample("cube", 5, METRIC_MEASURED, CONTRACT_EDGES, 60);
    check_sample("torus", 3, METRIC_MEASURED, CONTRACT_EDGES, 1500);
    check_sample("fin", 4, METRIC_MEASURED, CONTRACT_EDGES | CONTRACT_FACES | CONTRACT_TETS, 500);
}

/* What is left within 2 % by a metric; and for the measured one, are all fields that drive within it when measured
 * anew? */
static void left_within(const struct tetmesh *mesh, enum metric metric, uint32_t fields, uint32_t *out_left)
{
    static const uint32_t controlled[2] = {0, 1};
    struct contraction_log s;
    struct ancestry ancestry;
    struct ancestry_level level;
    struct measure *measure;
    struct measured measured[2];
    struct simplify_options options = usual(mesh);
    double domain, range[2], nearest = 0;
    *out_left = 0;
    options.metric = metric;
    options.max_error = 0.02;
    REQUIRE(simplify(&s, mesh, controlled, fields, (double[]){1, 0.5}, &options, NULL) == TETLOD_OK);
    REQUIRE(ancestry_init(&ancestry, &s, mesh, NULL) == TETLOD_OK);
    REQUIRE(ancestry_level(&ancestry, s.count, &level, NULL) == TETLOD_OK);
    REQUIRE(measure_new(&measure, mesh, controlled, fields, 2, NULL) == TETLOD_OK);
    CHECK_INT(measure_mesh(measure, &level.mesh, controlled, 2, measured, &domain, NULL), TETLOD_OK);
    for (uint32_t f = 0; f < fields && metric == METRIC_MEASURED; f++) {
        point_field_range(&mesh->fields[f], mesh->vertex_count, range);
        double error = measured[f].sampled / (range[1] - range[0]), most = f ? 0.01 : 0.02;
        nearest = larger(nearest, error / most);
        if (error > most)
            TEST_FAIL("field %u: the error is %.12g, to be at most %g", f, error, most);
    }
    CHECK(nearest > 0.5 || metric != METRIC_MEASURED);
    *out_left = left(&s);
    measure_free(measure);
    ancestry_level_fini(&level);
    ancestry_fini(&ancestry);
    log_fini(&s);
}

static void test_measured_limit_holds(void)
{
    for (int i = 0; i < 3; i++) {
        struct tetmesh mesh = {0};
        if (i == 0)
            make_jittered(&mesh, 6, 31);
        else
            REQUIRE(sample_find(i == 1 ? "torus" : "fin")->make(&mesh, 4, NULL) == TETLOD_OK);
        uint32_t fields = i == 2 ? 2 : 1, envelope, measured;
        left_within(&mesh, METRIC_ENVELOPE, fields, &envelope);
        left_within(&mesh, METRIC_MEASURED, fields, &measured);
        if (measured >= envelope)
            TEST_FAIL("mesh %d: %u tetrahedra are left, by the envelope %u", i, measured, envelope);
        tetmesh_fini(&mesh);
    }
}

static void test_faces_and_tetrahedra(void)
{
    check_sample("cube", 5, METRIC_ENVELOPE, CONTRACT_EDGES | CONTRACT_FACES | CONTRACT_TETS, 60);
    check_sample("torus", 2, METRIC_ENVELOPE, CONTRACT_FACES, 1000);
    check_sample("fin", 4, METRIC_ENVELOPE, CONTRACT_TETS, 500);
}

static void test_jittered(void)
{
    for (uint64_t seed = 1; seed < (SANITIZED ? 2 : 4); seed++) {
        struct tetmesh mesh = {0};
        make_jittered(&mesh, 5, seed);
        struct simplify_options options = usual(&mesh);
        check_sequence(&mesh, &options, 120);
        tetmesh_fini(&mesh);
    }
}

/* Listed the other way round, a mesh is contracted the same. */
static void test_reversed(void)
{
    struct tetmesh mesh = {0};
    make_jittered(&mesh, 4, 9);
    for (uint32_t t = 0; t < mesh.tet_count; t++) {
        uint32_t swap = mesh.corners[4 * t];
        mesh.corners[4 * t] = mesh.corners[4 * t + 1];
        mesh.corners[4 * t + 1] = swap;
    }
    struct simplify_options options = usual(&mesh);
    check_sequence(&mesh, &options, 120);
    tetmesh_fini(&mesh);
}

static void check_threads(enum metric metric, enum certify certify)
{
    struct tetmesh mesh = {0};
    struct contraction_log s[2];
    make_jittered(&mesh, 6, 4);
    struct simplify_options options = usual(&mesh);
    options.metric = metric;
    options.certify = certify;
    for (unsigned i = 0; i < 2; i++) {
        options.threads = i ? 3 : 1;
        REQUIRE(simplify(&s[i], &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    }
    size_t count = s[0].count;
    CHECK_INT(count, s[1].count);
    CHECK_INT(s[0].mark_count, s[1].mark_count);
    CHECK(count > 100);
    CHECK(memcmp(s[0].children, s[1].children, 16 * count) == 0);
    CHECK(memcmp(s[0].positions, s[1].positions, 24 * count) == 0);
    CHECK(memcmp(s[0].fields[0].values, s[1].fields[0].values, 8 * count) == 0);
    CHECK(memcmp(s[0].certified, s[1].certified, sizeof(double) * s[0].mark_count) == 0);
    for (unsigned i = 0; i < 2; i++)
        log_fini(&s[i]);
    tetmesh_fini(&mesh);
}

static void test_threads_do_not_matter(void)
{
    check_threads(METRIC_ENVELOPE, CERTIFY_FAST);
    check_threads(METRIC_MEASURED, CERTIFY_FAST);
    check_threads(METRIC_FIELD_QUADRIC, CERTIFY_EXACT);
}

/* A linear field costs nothing: what the boundary allows goes at error 0. */
static void test_linear_field(void)
{
    struct tetmesh mesh = {0};
    struct contraction_log s;
    make_jittered(&mesh, 5, 12);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh.fields[0].values[v] = mesh.positions[3 * v] - 2 * mesh.positions[3 * v + 1] + 3;
    struct simplify_options options = usual(&mesh);
    options.max_error = 1e-6;
    REQUIRE(simplify(&s, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    if (left(&s) > 60)
        TEST_FAIL("%u of %u tetrahedra are left", left(&s), mesh.tet_count);
    CHECK(s.certified[s.mark_count - 1] <= 1e-6);
    log_fini(&s);
    tetmesh_fini(&mesh);
}

static void test_limits(void)
{
    struct tetmesh mesh = {0};
    struct contraction_log s;
    make_jittered(&mesh, 5, 21);
    struct simplify_options options = usual(&mesh);
    options.min_tets = 300;
    REQUIRE(simplify(&s, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    CHECK(left(&s) <= 300 && left(&s) > 250);
    log_fini(&s);
    options.min_tets = 1;
    options.max_error = 0.1;
    check_sequence(&mesh, &options, mesh.tet_count - 1);
    options.max_error = 5; // more than the whole range
    check_sequence(&mesh, &options, 120);
    options.metric = METRIC_SVA;
    check_sequence(&mesh, &options, 120);
    tetmesh_fini(&mesh);
}

static bool cancel(void *opaque, double done)
{
    ++*(int *)opaque;
    CHECK(done >= 0 && done <= 1);
    return *(int *)opaque < 2;
}

static void test_cancelled(void)
{
    struct tetmesh mesh = {0};
    struct contraction_log s;
    int calls = 0;
    make_jittered(&mesh, 9, 5);
    struct simplify_options options = usual(&mesh);
    options.progress = cancel;
    options.progress_opaque = &calls;
    CHECK_INT(simplify(&s, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL), TETLOD_ERR_CANCELLED);
    CHECK_INT(calls, 2);
    CHECK(!s.marks && !s.children);
    tetmesh_fini(&mesh);
}

/* A body of one tetrahedron stays, whatever holds the error. */
static void test_single_tetrahedron(void)
{
    double positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, values[] = {0, 1, 2, 3};
    uint32_t corners[] = {0, 1, 2, 3};
    char name[] = "f";
    struct point_field field = {.name = name, .components = 1, .type = TETLOD_FLOAT64, .values = values};
    struct tetmesh mesh = {.position_type = TETLOD_FLOAT64, .vertex_count = 4, .tet_count = 1, .positions = positions,
                           .corners = corners, .field_count = 1, .fields = &field};
    static const enum metric metrics[] = {METRIC_ENVELOPE, METRIC_FIELD_QUADRIC, METRIC_QUADRIC, METRIC_SVA,
                                          METRIC_MEASURED, METRIC_FIELD_QUADRIC};
    for (size_t i = 0; i < sizeof metrics / sizeof *metrics; i++) {
        struct contraction_log s;
        struct simplify_options options = usual(&mesh);
        options.metric = metrics[i];
        options.certify = i + 1 == sizeof metrics / sizeof *metrics ? CERTIFY_EXACT : CERTIFY_FAST;
        REQUIRE(simplify(&s, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
        CHECK_INT(s.marks[s.mark_count - 1].contractions, 0);
        log_fini(&s);
    }
}

int main(void)
{
    RUN(test_samples_by_envelope);
    RUN(test_curved_boundary);
    RUN(test_coincident_vertices);
    RUN(test_samples_by_prediction);
    RUN(test_samples_exactly);
    RUN(test_samples_by_measured_error);
    RUN(test_measured_limit_holds);
    RUN(test_faces_and_tetrahedra);
    RUN(test_jittered);
    RUN(test_reversed);
    RUN(test_threads_do_not_matter);
    RUN(test_linear_field);
    RUN(test_limits);
    RUN(test_cancelled);
    RUN(test_single_tetrahedron);
    return test_end();
}
