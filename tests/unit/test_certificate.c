/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * What is promised of every level, by who has only the stream and the original: at random points the error is not above
 * the stored `max`; no tetrahedron flips or degenerates, topology stays, the boundary is within the stored domain
 * error. Quickly on small samples; CERTIFICATE=1 in the environment (make bench-certificate): 100 random levels of all
 * samples and of the blunt fin, 200,000 points each.
 */
#include <stdlib.h>

#include "src/pipeline/build.h"
#include "src/measure/measure.h"
#include "src/simplify/simplify.h"
#include "src/io/io.h"
#include "src/mesh/locate.h"
#include "src/mesh/mesh_check.h"
#include "src/mesh/tet_geom.h"
#include "src/stream/level_mesh.h"
#include "src/sample/sample.h"
#include "src/util/array.h"
#include "src/util/parallel.h"
#include "tests/gen.h"
#include "tests/memory_sink.h"
#include "tests/test.h"

enum { MAX_TETS = 256, MAX_VIOLATIONS = 5 };

static bool whole; /* the whole of it, which takes minutes */

/* A level against the original. */
struct trial_run {
    const struct tetmesh *original, *level;
    struct locator locators[2]; /* of the original, of the level */
    uint64_t seed;
    double *errors;    /* [point] of field 0, NaN: the level has no value there */
    double *distances; /* [point] of those that are outside of the level */
};

static double value_at(const struct tetmesh *mesh, const uint32_t *vertices, const double *weights)
{
    double sum = 0;
    for (int i = 0; i < 4; i++)
        sum += weights[i] * mesh->fields[0].values[vertices[i]];
    return sum;
}

static bool has_interpolant(const struct tetmesh *mesh, uint32_t tet)
{
    const double *p[4];
    for (int c = 0; c < 4; c++)
        p[c] = mesh->positions + 3 * (size_t)mesh->corners[4 * (size_t)tet + (size_t)c];
    return tet_orientation(p[0], p[1], p[2], p[3]) != 0;
}

/* A random point of a random tetrahedron; where the level has several values there, the nearest counts. */
static void try_point(struct trial_run *run, size_t point)
{
    uint64_t random = run->seed + 0x9e3779b97f4a7c15u * point;
    uint32_t tet = (uint32_t)(gen_random(&random) % run->original->tet_count), tets[MAX_TETS];
    const uint32_t *corners = run->original->corners + 4 * (size_t)tet;
    double weights[4], total = 0, p[3] = {0, 0, 0};
    run->errors[point] = NAN;
    run->distances[point] = 0;
    if (!has_interpolant(run->original, tet))
        return;
    for (int c = 0; c < 4; c++)
        total += weights[c] = -log(1 - gen_unit(&random)) + 1e-12; // evenly over the tetrahedron
    for (int c = 0; c < 4; c++) {
        weights[c] /= total;
        for (int d = 0; d < 3; d++)
            p[d] += weights[c] * run->original->positions[3 * (size_t)corners[c] + (size_t)d];
    }
    double value = value_at(run->original, corners, weights), best = INFINITY;
    uint32_t count = locator_find(&run->locators[1], p, tets, MAX_TETS);
    for (uint32_t i = 0; i < count; i++) {
        if (!has_interpolant(run->level, tets[i]))
            continue;
        locator_weights(&run->locators[1], tets[i], p, weights);
        best = smaller(best, fabs(value_at(run->level, run->level->corners + 4 * (size_t)tets[i], weights) - value));
    }
    struct place place;
    run->errors[point] = isfinite(best) ? best : NAN;
    run->distances[point] = count ? 0 : locator_closest(&run->locators[1], p, &place);
}

static void try_points(void *context, unsigned worker, size_t begin, size_t end)
{
    (void)worker;
    for (size_t point = begin; point < end; point++)
        try_point(context, point);
}

static void check_counts(const char *name, uint32_t k, const struct mesh_report *level,
                         const struct mesh_report *original)
{
    if (level->inverted_tets > original->inverted_tets || level->degenerate_tets > original->degenerate_tets ||
        level->duplicate_tets > original->duplicate_tets || level->overfull_faces > original->overfull_faces ||
        level->singular_vertices > original->singular_vertices)
        TEST_FAIL("%s, level %u: %u inverted, %u degenerate, %u duplicate tetrahedra, %llu faces of more than two, %u "
                  "singular "
                  "vertices", name, k, level->inverted_tets, level->degenerate_tets, level->duplicate_tets,
                  (unsigned long long)level->overfull_faces, level->singular_vertices);
    if (level->euler != original->euler || level->components != original->components ||
        level->boundary_components != original->boundary_components)
        TEST_FAIL("%s, level %u: its topology is another one", name, k);
}

/* The largest distance of a boundary vertex of one from the other's boundary. */
static double boundary_distance(const struct trial_run *run)
{
    double most = 0;
    struct place place;
    for (int from = 0; from < 2; from++) {
        const struct locator *locator = &run->locators[from];
        for (size_t i = 0; i < 3 * (size_t)locator->surface.count; i++)
            most = larger(most,
                          locator_closest(&run->locators[!from],
                                          locator->positions + 3 * (size_t)locator->surface.triangles[i], &place));
    }
    return most;
}

static void compare_points(const char *name, uint32_t k, struct trial_run *run, size_t points, double max,
                           double domain)
{
    int violations = 0;
    double worst = 0;
    parallel_for(2, points, 256, try_points, run);
    for (size_t i = 0; i < points && violations < MAX_VIOLATIONS; i++) {
        bool above = run->errors[i] > max * (1 + 1e-6) + 1e-9, outside = run->distances[i] > domain;
        worst = larger(worst, isnan(run->errors[i]) ? 0 : run->errors[i]);
        violations += above || outside;
        if (above || outside)
            TEST_FAIL("%s, level %u, point %zu: error %.9g, max %.9g; distance %g, domain error %g", name, k, i,
                      run->errors[i], max,
                      run->distances[i], domain);
    }
    printf("# %s, level %u: %u tetrahedra, max %.3g, found %.3g\n", name, k, run->level->tet_count, max, worst);
}

static void check_level(const char *name, const struct tetlod_info *info, uint32_t k, const struct tetmesh *original,
                        const struct tetmesh *level, const struct mesh_report *start, uint64_t seed)
{
    size_t points = whole ? 200000 : 10000;
    double range[2], diagonal = mesh_diagonal(original);
    struct trial_run run = {.original = original, .level = level, .seed = seed,
                            .errors = array_new(points, sizeof(double)),
                            .distances = array_new(points, sizeof(double))};
    struct mesh_report report;
    REQUIRE(run.errors && run.distances);
    for (int i = 0; i < 2; i++) {
        const struct tetmesh *mesh = i ? level : original;
        REQUIRE(locator_init(&run.locators[i], mesh->positions, mesh->vertex_count, mesh->corners, mesh->tet_count,
                             NULL) == TETLOD_OK);
    }
    REQUIRE(mesh_check(level->positions, level->corners, level->vertex_count, level->tet_count, &report,
                       NULL) == TETLOD_OK);
    check_counts(name, k, &report, start);
    point_field_range(&original->fields[0], original->vertex_count, range);
    double domain = info->levels[k].domain_error * (1 + 1e-6) * diagonal + 1e-12 * diagonal;
    double moved = boundary_distance(&run);
    if (moved > domain)
        TEST_FAIL("%s, level %u: the boundary has moved by %g, stored is %g", name, k, moved, domain);
    compare_points(name, k, &run, points, info->levels[k].errors[TETLOD_MAX] * (range[1] - range[0]), domain);
    for (int i = 0; i < 2; i++)
        locator_fini(&run.locators[i]);
    free(run.errors);
    free(run.distances);
}

static void check_stream(const char *name, const struct tetmesh *original, struct tetlod_file *file, uint32_t levels,
                         uint64_t seed)
{
    const struct tetlod_info *info = tetlod_info(file);
    struct tetlod_cursor *cursor;
    struct mesh_report start;
    REQUIRE(tetlod_cursor_new(&cursor, file, NULL, 0, NULL) == TETLOD_OK);
    REQUIRE(mesh_check(original->positions, original->corners, original->vertex_count, original->tet_count, &start,
                       NULL) == TETLOD_OK);
    for (uint32_t i = 0; i < levels; i++) {
        struct tetmesh level;
        uint32_t k = (uint32_t)(gen_random(&seed) % info->level_count);
        REQUIRE(tetlod_cursor_seek(cursor, k, NULL) == TETLOD_OK);
        REQUIRE(level_mesh_copy(info, cursor, &level, NULL) == TETLOD_OK);
        check_level(name, info, k, original, &level, &start, seed);
        tetmesh_fini(&level);
    }
    tetlod_cursor_free(cursor);
}

/* A way to build. The error limit keeps what is slow in the end short: coarser levels have nothing to show. */
struct way {
    const char *name;
    enum metric metric;
    enum certify certify;
    unsigned contract;
};

static const struct way ways[] = {{"fast", METRIC_ENVELOPE, CERTIFY_FAST, CONTRACT_EDGES},
                                  {"exact", METRIC_FIELD_QUADRIC, CERTIFY_EXACT, CONTRACT_EDGES},
                                  {"measured", METRIC_MEASURED, CERTIFY_FAST, CONTRACT_EDGES},
                                  {"hybrid", METRIC_FIELD_QUADRIC, CERTIFY_FAST,
                                   CONTRACT_EDGES | CONTRACT_FACES | CONTRACT_TETS}};

enum { WAYS = sizeof ways / sizeof *ways };

/* By the first field, which alone is kept. */
static void check_mesh(const char *name, struct tetmesh *mesh, const struct way *way, uint32_t levels, uint64_t seed)
{
    struct memory_sink memory = {0};
    struct tetlodi_sink sink = memory_sink(&memory);
    struct tetlod_file *file;
    struct build_report report;
    const struct build_control control = {0};
    const struct build_options options = {.controls = &control,
                                          .control_count = 1,
                                          .metric = way->metric,
                                          .certify = way->certify,
                                          .contract = way->contract,
                                          .max_error = whole ? 0.1 : 1,
                                          .min_tets = 1,
                                          .boundary_angle = 30,
                                          .domain_error = 1e-3,
                                          .growth = whole ? 1.05 : 1.2,
                                          .compression = 1,
                                          .threads = 2,
                                          .metadata = "{}"};
    char text[64];
    snprintf(text, sizeof text, "%s, %s", name, way->name);
    REQUIRE(build_stream(mesh, &options, &sink, &report, NULL) == TETLOD_OK);
    REQUIRE(tetlod_open_memory(&file, memory.bytes, memory.size, NULL, NULL) == TETLOD_OK);
    check_stream(text, mesh, file, levels, seed);
    tetlod_close(file);
    free(memory.bytes);
}

static void keep_one_field(struct tetmesh *mesh, uint32_t kept)
{
    for (uint32_t f = 0; f < mesh->field_count; f++) {
        if (f == kept)
            continue;
        free(mesh->fields[f].name);
        free(mesh->fields[f].values);
    }
    mesh->fields[0] = mesh->fields[kept];
    mesh->field_count = 1;
}

static void test_samples(void)
{
    uint64_t seed = 20;
    for (const struct sample *sample = samples; sample->name; sample++)
        for (int w = 0; w < WAYS; w++) {
            struct tetmesh mesh = {0};
            uint32_t small = sample->least_size > 3 ? sample->least_size : 3;
            REQUIRE(sample->make(&mesh, whole && w != 3 ? sample->default_size : small, NULL) == TETLOD_OK);
            keep_one_field(&mesh, 0);
            check_mesh(sample->name, &mesh, &ways[w], whole ? 4 : 2, seed++);
            tetmesh_fini(&mesh);
        }
}

static void test_blunt_fin(void)
{
    const char *folder = getenv("BLUNT"), *root = getenv("ROOT");
    char grid[1024], solution[1024];
    struct tetmesh mesh;
    if (!whole)
        SKIP("make bench-certificate does it");
    for (int i = 0; i < 2; i++)
        snprintf(i ? solution : grid, sizeof grid, "%s%s/%s", folder ? folder : root ? root : ".",
                 folder ? "" : "/../shared/data",
                 i ? "bluntfinq.bin" : "bluntfinxyz.bin");
    const struct io_read_options reading = {.solution = solution};
    if (io_read(&mesh, grid, &reading, NULL, NULL) != TETLOD_OK)
        SKIP("no blunt fin data");
    keep_one_field(&mesh, tetmesh_find_field(&mesh, "Pressure"));
    check_mesh("blunt fin", &mesh, &ways[0], 20, 7);
    tetmesh_fini(&mesh);
}

int main(void)
{
    whole = getenv("CERTIFICATE") != NULL;
    RUN(test_samples);
    RUN(test_blunt_fin);
    return test_end();
}
