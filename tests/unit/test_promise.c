/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The promise on meshes that are hard to keep it for: values far from zero, folds, bodies that touch. Of every level,
 * `max` is not below what the overlay and random points find, nor below `sampled`; nothing is outside the domain error.
 */
#include <stdlib.h>

#include "src/measure/measure.h"
#include "src/measure/overlay.h"
#include "src/mesh/locate.h"
#include "src/mesh/tet_geom.h"
#include "src/pipeline/build.h"
#include "src/stream/level_mesh.h"
#include "src/sample/sample.h"
#include "src/util/array.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

enum { POINTS = 3000, MAX_TETS = 64 };

/* ---- meshes */

/* A block of n^3 cubes from `corner`, `size` wide, added to the mesh; inside, vertices are shaken by up to this much of
 * a cube. */
static void add_block(struct tetmesh *mesh, uint32_t n, const double corner[3], const double size[3], double shaken,
                      uint64_t seed)
{
    static const uint8_t path[6][2] = {{1, 2}, {2, 1}, {2, 4}, {4, 2}, {4, 1}, {1, 4}};
    uint32_t side = n + 1, first = mesh->vertex_count;
    for (uint32_t v = 0; v < side * side * side; v++) {
        const uint32_t at[3] = {v % side, v / side % side, v / side / side};
        bool inside = true;
        for (int d = 0; d < 3; d++)
            inside &= at[d] > 0 && at[d] < n;
        for (int d = 0; d < 3; d++)
            mesh->positions[3 * (size_t)mesh->vertex_count + (size_t)d] =
                corner[d] + size[d] * (at[d] + (inside ? shaken * (gen_unit(&seed) - 0.5) : 0)) / n;
        mesh->vertex_count++;
    }
    for (uint32_t c = 0; c < n * n * n; c++)
        for (int t = 0; t < 6; t++) {
            uint32_t base = first + c % n + side * (c / n % n) + side * side * (c / n / n), steps[8];
            for (uint32_t b = 0; b < 8; b++)
                steps[b] = base + (b & 1) + (b >> 1 & 1) * side + (b >> 2) * side * side;
            const uint32_t corners[4] = {base, steps[path[t][0]], steps[path[t][0] | path[t][1]], steps[7]};
            memcpy(mesh->corners + 4 * (size_t)mesh->tet_count++, corners, sizeof corners);
        }
}

/* Turns each tetrahedron so that its volume is positive. */
static void turn_each(struct tetmesh *mesh)
{
    for (size_t t = 0; t < mesh->tet_count; t++) {
        uint32_t *c = mesh->corners + 4 * t, swap = c[2];
        const double *p = mesh->positions;
        if (tet_volume6(p + 3 * (size_t)c[0], p + 3 * (size_t)c[1], p + 3 * (size_t)c[2], p + 3 * (size_t)c[3]) >= 0)
            continue;
        c[2] = c[3];
        c[3] = swap;
    }
}

/* A block at the origin, with a field, and room for another. */
static bool new_block(struct tetmesh *mesh, uint32_t n, const double size[3], double shaken, uint64_t seed)
{
    size_t vertices = 2 * (size_t)(n + 1) * (n + 1) * (n + 1), tets = 12 * (size_t)n * n * n;
    *mesh = (struct tetmesh){.vertex_count = (uint32_t)vertices, .position_type = TETLOD_FLOAT64};
    mesh->positions = array_new(vertices, 3 * sizeof(double));
    mesh->corners = array_new(tets, 4 * sizeof(uint32_t));
    bool done = mesh->positions && mesh->corners && tetmesh_add_field(mesh, "s", 1, TETLOD_FLOAT64, NULL) == TETLOD_OK;
    mesh->vertex_count = 0;
    if (done)
        add_block(mesh, n, (const double[3]){0, 0, 0}, size, shaken, seed);
    return done;
}

/* ---- the promise */

struct checked {
    const char *name;
    const struct tetmesh *original;
    double range, diagonal;
};

/* The difference at a point of the original, or -1 where the level has none; where it has several, the least. */
static double point_error(const struct checked *c, const struct tetmesh *level, const struct locator *locator,
                          uint64_t *random)
{
    const double *values = c->original->fields[0].values, base = values[0];
    uint32_t tet = (uint32_t)(gen_random(random) % c->original->tet_count), tets[MAX_TETS];
    double weights[4], total = 0, p[3] = {0, 0, 0}, value = 0, best = INFINITY;
    for (int i = 0; i < 4; i++)
        total += weights[i] = -log(1 - gen_unit(random)) + 1e-12;
    for (int i = 0; i < 4; i++) {
        uint32_t v = c->original->corners[4 * (size_t)tet + (size_t)i];
        value += weights[i] / total * (values[v] - base);
        for (int d = 0; d < 3; d++)
            p[d] += weights[i] / total * c->original->positions[3 * (size_t)v + (size_t)d];
    }
    uint32_t count = locator_find(locator, p, tets, MAX_TETS);
    for (uint32_t k = 0; k < count; k++) {
        double found = -value;
        locator_weights(locator, tets[k], p, weights);
        for (int i = 0; i < 4; i++)
            found += weights[i] * (level->fields[0].values[level->corners[4 * (size_t)tets[k] + (size_t)i]] - base);
        best = smaller(best, fabs(found));
    }
    return isinf(best) ? -1 : best;
}

/* The largest distance of points of either boundary, also inside faces, from the other. */
static double boundary_distance(const struct locator locators[2], uint64_t *random)
{
    double most = 0;
    for (int from = 0; from < 2; from++)
        for (size_t f = 0; f < locators[from].surface.count; f++) {
            double weights[3], total = 0, p[3] = {0, 0, 0};
            struct place place;
            for (int k = 0; k < 3; k++)
                total += weights[k] = gen_unit(random) + 1e-9;
            for (int k = 0; k < 3; k++)
                for (int d = 0; d < 3; d++)
                    p[d] += weights[k] / total *
                            locators[from].positions[3 * (size_t)locators[from].surface.triangles[3 * f + (size_t)k] +
                                                     (size_t)d];
            most = larger(most, locator_closest(&locators[!from], p, &place));
        }
    return most;
}

static void check_level(const struct checked *c, const struct tetlod_level *stored, uint32_t k,
                        const struct tetmesh *level)
{
    static const uint32_t fields[1] = {0};
    uint64_t random = k;
    struct locator locators[2], *locator = &locators[1];
    struct overlay_report report;
    struct measure *measure;
    struct measured measured;
    double exact, domain, found = 0;
    for (int i = 0; i < 2; i++) {
        const struct tetmesh *mesh = i ? level : c->original;
        REQUIRE(locator_init(&locators[i], mesh->positions, mesh->vertex_count, mesh->corners, mesh->tet_count,
                             NULL) == TETLOD_OK);
    }
    for (int i = 0; i < POINTS; i++)
        found = larger(found, point_error(c, level, locator, &random));
    REQUIRE(overlay_max(c->original, fields, level, fields, 1, &(struct overlay_options){.threads = 2}, &exact,
                        &report, NULL) == TETLOD_OK);
    REQUIRE(measure_new(&measure, c->original, fields, 1, 2, NULL) == TETLOD_OK);
    REQUIRE(measure_mesh(measure, level, fields, 2, &measured, &domain, NULL) == TETLOD_OK);
    double max = stored->errors[TETLOD_MAX] * (1 + 1e-9) + 1e-13;
    if (found > max * c->range || exact > max * c->range || measured.sampled > max * c->range ||
        stored->errors[TETLOD_SAMPLED] > stored->errors[TETLOD_MAX])
        TEST_FAIL("%s, level %u of %u tetrahedra: max is %.10g, sampled %.10g; at points %.10g, by the overlay %.10g, "
                  "measured %.10g",
                  c->name, k, level->tet_count, stored->errors[TETLOD_MAX], stored->errors[TETLOD_SAMPLED],
                  found / c->range, exact / c->range, measured.sampled / c->range);
    domain = larger(domain, boundary_distance(locators, &random));
    if (domain > stored->domain_error * c->diagonal * (1 + 1e-9) + 1e-13 * c->diagonal)
        TEST_FAIL("%s, level %u: its domain error is %g, stored is %g", c->name, k, domain / c->diagonal,
                  stored->domain_error);
    measure_free(measure);
    locator_fini(&locators[0]);
    locator_fini(&locators[1]);
}

static struct build_options usual(const struct build_control *control)
{
    return (struct build_options){.controls = control,
                                  .control_count = 1,
                                  .metric = METRIC_ENVELOPE,
                                  .contract = CONTRACT_EDGES,
                                  .max_error = 1,
                                  .min_tets = 1,
                                  .boundary_angle = 30,
                                  .domain_error = 1e-3,
                                  .growth = 1.3,
                                  .compression = 1,
                                  .threads = 2,
                                  .metadata = "{}"};
}

/* Builds, and holds every level against the promise. *out_tets, unless NULL: how many tetrahedra the coarsest has. */
static void check(const char *name, const struct tetmesh *mesh, const struct build_options *options,
                  struct build_report *report)
{
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct checked c = {name, mesh, 0, mesh_diagonal(mesh)};
    struct tetlod_file *file;
    struct tetlod_cursor *cursor;
    double range[2];
    point_field_range(&mesh->fields[0], mesh->vertex_count, range);
    c.range = range[1] - range[0];
    REQUIRE(build_stream(mesh, options, &sink, report, NULL) == TETLOD_OK);
    REQUIRE(tetlod_open_memory(&file, memory.bytes, memory.size, NULL, NULL) == TETLOD_OK);
    REQUIRE(tetlod_cursor_new(&cursor, file, NULL, 0, NULL) == TETLOD_OK);
    for (uint32_t k = 0; k < tetlod_info(file)->level_count; k++) {
        struct tetmesh level;
        REQUIRE(tetlod_cursor_seek(cursor, k, NULL) == TETLOD_OK);
        REQUIRE(level_mesh_copy(tetlod_info(file), cursor, &level, NULL) == TETLOD_OK);
        check_level(&c, &tetlod_info(file)->levels[k], k, &level);
        tetmesh_fini(&level);
    }
    tetlod_cursor_free(cursor);
    tetlod_close(file);
    free(memory.bytes);
}

/* ---- the cases */

static const double cube[3] = {1, 1, 1};

static void test_far_from_zero(void)
{
    static const double offsets[][2] = {{-1e4, 1e-7}, {1e6, 1e-4}, {101325, 1e-2}, {1e9, 1e-3}};
    static const double thin[3] = {1, 1, 1e-3};
    const struct build_control control = {0};
    for (int i = 0; i < 8; i++) {
        struct build_options options = usual(&control);
        struct build_report report;
        struct tetmesh mesh;
        REQUIRE(new_block(&mesh, 3, i % 2 ? thin : cube, 0.5, (uint64_t)i));
        for (uint32_t v = 0; v < mesh.vertex_count; v++) {
            const double *p = mesh.positions + 3 * (size_t)v;
            mesh.fields[0].values[v] = offsets[i / 2][0] + offsets[i / 2][1] * (sin(5 * p[0]) * p[1] + p[0] * p[0]);
        }
        options.certify = i % 2 ? CERTIFY_EXACT : CERTIFY_FAST;
        options.metric = i % 2 ? METRIC_FIELD_QUADRIC : METRIC_ENVELOPE;
        check("far from zero", &mesh, &options, &report);
        tetmesh_fini(&mesh);
    }
}

/* A shaken grid whose tetrahedra are turned one by one: neighbours overlap, and every volume is positive. */
static void test_folds(void)
{
    const struct build_control control = {0};
    for (uint64_t seed = 0; seed < 6; seed++) {
        struct build_options options = usual(&control);
        struct build_report report = {0};
        struct tetmesh mesh;
        REQUIRE(new_block(&mesh, 4, cube, 1.5, seed));
        turn_each(&mesh);
        for (uint32_t v = 0; v < mesh.vertex_count; v++)
            mesh.fields[0].values[v] = mesh.positions[3 * (size_t)v] + 0.5 * mesh.positions[3 * (size_t)v + 1];
        options.certify = seed % 2 ? CERTIFY_EXACT : CERTIFY_FAST;
        check("folded", &mesh, &options, &report);
        CHECK_INT(report.inverted_tets, 0);
        CHECK(report.folded_tets > 0);
        tetmesh_fini(&mesh);
    }
}

/* Two bodies with a value each, which touch, overlap, or have a gap between them: the boundary of one must not be taken
 * for the other's. */
static void test_bodies(void)
{
    static const double corners[][3] = {{0, 0, 1}, {0.3, 0.2, 1}, {0, 0, 1.0005}, {0.25, 0.25, 0.75}};
    const struct build_control control = {0};
    for (int i = 0; i < 8; i++) {
        struct build_options options = usual(&control);
        struct build_report report;
        struct tetmesh mesh;
        REQUIRE(new_block(&mesh, 3, cube, 0.3, 1));
        uint32_t first = mesh.vertex_count;
        add_block(&mesh, 3, corners[i / 2], cube, 0.3, 2);
        for (uint32_t v = 0; v < mesh.vertex_count; v++) {
            double *p = mesh.positions + 3 * (size_t)v;
            mesh.fields[0].values[v] = v >= first;
            p[2] += 0.02 * sin(3 * p[0]) * cos(2 * p[1]); // no face is plane
        }
        options.domain_error = i % 2 ? 1e-3 : 0.03;
        options.certify = i == 1 ? CERTIFY_EXACT : CERTIFY_FAST;
        check("two bodies", &mesh, &options, &report);
        tetmesh_fini(&mesh);
    }
}

/* Rounding moves the boundary, too. */
static void test_rounded_positions(void)
{
    const struct build_control control = {0};
    for (unsigned bits = 5; bits < 10; bits += 2) {
        struct build_options options = usual(&control);
        struct build_report report;
        struct tetmesh mesh = {0};
        REQUIRE(sample_find("torus")->make(&mesh, 3, NULL) == TETLOD_OK);
        options.quantise.position_bits = bits;
        check("rounded positions", &mesh, &options, &report);
        tetmesh_fini(&mesh);
    }
}

/* A boundary that may move far leaves points behind and comes back to them: `max` is for the same position all the
 * same. */
static void test_the_boundary_comes_back(void)
{
    const struct build_control control = {0};
    for (uint32_t i = 0; i < 6; i++) {
        struct build_options options = usual(&control);
        struct build_report report;
        struct tetmesh mesh = {0};
        REQUIRE(sample_find("torus")->make(&mesh, 2 + i % 3, NULL) == TETLOD_OK);
        for (uint32_t v = 0; v < mesh.vertex_count && i >= 3; v++) { // a flat ring of another field
            double *p = mesh.positions + 3 * (size_t)v;
            p[2] = (double)(float)(0.4 * p[2]);
            mesh.fields[0].values[v] = (double)(float)(sin(4 * p[0]) * p[1] + p[2]);
        }
        options.domain_error = 0.3;
        options.boundary_angle = 60;
        options.growth = 5;
        check("torus", &mesh, &options, &report);
        tetmesh_fini(&mesh);
    }
}

/* A carried field whose range has no reciprocal: of an error no more is said than that there is one. One whose range is
 * no number is refused. */
static void test_ranges_without_scale(void)
{
    const struct build_control control = {0};
    struct build_options options = usual(&control);
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct build_report report;
    struct tetlod_file *file;
    struct tetmesh mesh;
    REQUIRE(new_block(&mesh, 3, cube, 0.5, 1));
    REQUIRE(tetmesh_add_field(&mesh, "tiny", 1, TETLOD_FLOAT64, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        const double *p = mesh.positions + 3 * (size_t)v;
        mesh.fields[0].values[v] = p[0];
        mesh.fields[1].values[v] = 3e-313 * p[1] * p[2];
    }
    REQUIRE(build_stream(&mesh, &options, &sink, &report, NULL) == TETLOD_OK);
    REQUIRE(tetlod_open_memory(&file, memory.bytes, memory.size, NULL, NULL) == TETLOD_OK);
    const struct tetlod_info *info = tetlod_info(file);
    for (uint32_t k = 0; k < info->level_count; k++) {
        const double *errors = info->levels[k].errors + TETLOD_MEASURES;
        CHECK((errors[TETLOD_SAMPLED] == 0 || errors[TETLOD_SAMPLED] == 1) &&
              errors[TETLOD_RMS] == errors[TETLOD_SAMPLED]);
        CHECK(k || errors[TETLOD_SAMPLED] == 1);
        CHECK(isnan(errors[TETLOD_MAX]));
    }
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh.fields[1].values[v] = v % 2 ? 1.7e308 : -1.7e308;
    CHECK_INT(build_stream(&mesh, &options, &sink, &report, NULL), TETLOD_ERR_MESH);
    tetlod_close(file);
    free(memory.bytes);
    tetmesh_fini(&mesh);
}

int main(void)
{
    RUN(test_far_from_zero);
    RUN(test_folds);
    RUN(test_bodies);
    RUN(test_rounded_positions);
    RUN(test_the_boundary_comes_back);
    RUN(test_ranges_without_scale);
    return test_end();
}
