/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The parallel rounds: the same bytes on any number of threads and with either arithmetic; rings and stars of any size
 * are contracted, and what is refused is counted; a run stops at its limits.
 */
#include "src/simplify/rounds/rounds.h"

#include <stdlib.h>

#include "src/sample/sample.h"
#include "src/simplify/mesh/border.h"
#include "src/simplify/mesh/clearance.h"
#include "src/simplify/mesh/kernels.h"
#include "src/simplify/simplify.h"
#include "src/measure/measure.h"
#include "src/mesh/tet_geom.h"
#include "src/util/array.h"
#include "tests/gen.h"
#include "tests/pyramid.h"
#include "tests/test.h"

static struct simplify_options usual(const struct tetmesh *mesh, unsigned threads)
{
    return (struct simplify_options){.metric = METRIC_ENVELOPE,
                                     .contract = CONTRACT_EDGES,
                                     .max_error = 1,
                                     .min_tets = 1,
                                     .boundary_angle = 30,
                                     .boundary_limit = 1e-3 * mesh_diagonal(mesh),
                                     .growth = 1.2,
                                     .threads = threads};
}

static uint64_t digest(uint64_t hash, const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ ((const uint8_t *)bytes)[i]) * UINT64_C(1099511628211);
    return hash;
}

static uint64_t log_digest(const struct contraction_log *log)
{
    uint64_t hash = digest(log->count, log->children, 16 * (size_t)log->count);
    hash = digest(hash, log->positions, 24 * (size_t)log->count);
    for (uint32_t f = 0; f < log->field_count; f++)
        hash = digest(hash, log->fields[f].values, 8 * (size_t)log->fields[f].components * log->count);
    hash = digest(hash, log->certified, log->component_count * (size_t)log->mark_count * sizeof(double));
    for (uint32_t m = 0; m < log->mark_count; m++)
        hash = digest(hash, &log->marks[m].contractions, 12);
    return hash;
}

/* ---- the same bytes */

static void check_threads(const char *sample, uint32_t size, uint32_t controlled_count)
{
    struct tetmesh mesh;
    uint64_t first = 0;
    printf("# %s %u\n", sample, size);
    REQUIRE(sample_find(sample)->make(&mesh, size, NULL) == TETLOD_OK);
    for (unsigned threads = 1; threads <= 8; threads += threads < 3 ? 1 : 5) {
        struct simplify_options options = usual(&mesh, threads);
        struct contraction_log log;
        REQUIRE(rounds_simplify(&log, &mesh, (uint32_t[]){0, 2}, controlled_count, NULL, &options, NULL) == TETLOD_OK);
        first = threads == 1 ? log_digest(&log) : first;
        CHECK(log_digest(&log) == first);
        CHECK(log.count > mesh.vertex_count / 2);
        log_fini(&log);
    }
    tetmesh_fini(&mesh);
}

static void test_threads_do_not_matter(void)
{
    check_threads("cube", SANITIZED ? 7 : 9, 1);
    check_threads("torus", 6, 1);
    check_threads("fin", 6, 2); // a scalar and the three components of the velocity
}

/* With the vertex moved by r: both kernels doubt the same tetrahedra, and all that turn over. */
static void check_doubt(const struct working *working, struct star_data star_data[2], const double r[3])
{
    const double *own = working_row(working, star_data[0].vertex), p[3] = {own[0] + r[0], own[1] + r[1], own[2] + r[2]};
    uint32_t count = kernels_plain.doubt(&star_data[0], working->component_count, r), turned = 0, doubted = 0;
    CHECK_INT(kernels_avx2.doubt(&star_data[1], working->component_count, r), count);
    CHECK_INT(memcmp(star_data[0].doubtful, star_data[1].doubtful, count * sizeof(uint32_t)), 0);
    for (uint32_t i = 0; i < star_data[0].tet_count; i++) {
        const double *q[3];
        for (int k = 0; k < 3; k++)
            q[k] = working_row(working, star_data[0].slots[star_data[0].corners[k][i]]);
        bool over = tet_orientation(p, q[0], q[1], q[2]) <= 0;
        turned += over;
        for (uint32_t j = 0; j < count; j++)
            doubted += over && star_data[0].doubtful[j] == i;
    }
    CHECK_INT(doubted, turned);
}

/* Every star of a mesh, by both. */
static void check_kernels(const struct tetmesh *mesh, const uint32_t *controlled, uint32_t count)
{
    struct contraction_log log;
    struct working working;
    struct star_data star_data[2] = {{0}};
    const struct kernels *kernels[2] = {&kernels_plain, &kernels_avx2};
    uint32_t slots = 0;
    REQUIRE(log_init(&log, mesh, NULL) == TETLOD_OK);
    REQUIRE(working_init(&working, mesh, NULL, controlled, count, NULL, &log, NULL) == TETLOD_OK);
    double factors[8], gaps[8] = {0};
    for (uint32_t c = 0; c < working.component_count; c++)
        factors[c] = working.components[c].factor;
    const struct edge_query query = {working.component_count, factors, gaps, 1, 0.05};
    for (uint32_t v = 0; v < working.slot_count; v++) {
        if (working.flags[v] & VERTEX_FROZEN)
            continue;
        slots++;
        for (int i = 0; i < 2; i++) {
            REQUIRE(star_data_gather(&star_data[i], &working, v));
            kernels[i]->prepare(&star_data[i], &working);
        }
        size_t planes = plane_count(working.component_count) * ((star_data[0].tet_count + 3) / 4 * 4);
        CHECK_INT(memcmp(star_data[0].planes, star_data[1].planes, planes * sizeof(double)), 0);
        for (uint32_t n = 0; n < star_data[0].count; n++) {
            struct edge_answer a = kernels[0]->query_edge(&star_data[0], n, &query, working.stride);
            struct edge_answer b = kernels[1]->query_edge(&star_data[1], n, &query, working.stride);
            size_t width = 2 * (size_t)working.component_count;
            CHECK(a.error == b.error && a.followed == b.followed && a.turned == b.turned &&
                  a.half_turned == b.half_turned);
            CHECK_INT(memcmp(star_data[0].reach + n * width, star_data[1].reach + n * width, width * sizeof(double)),
                      0);
            check_doubt(&working, star_data, star_data[0].rows + (size_t)n * working.stride);
        }
    }
    CHECK(slots > mesh->vertex_count / 2);
    star_data_fini(&star_data[0]);
    star_data_fini(&star_data[1]);
    working_fini(&working);
    log_fini(&log);
}

static void test_either_arithmetic(void)
{
    struct tetmesh mesh;
    if (kernels_choose() == &kernels_plain) {
        printf("# skipped: this processor has the plain one only\n");
        return;
    }
    REQUIRE(sample_find("fin")->make(&mesh, 5, NULL) == TETLOD_OK);
    check_kernels(&mesh, (uint32_t[]){0}, 1);
    check_kernels(&mesh, (uint32_t[]){0, 2}, 2);
    tetmesh_fini(&mesh);
}

/* ---- rings and stars of any size */

/* A cylinder of five layers: each sector a prism of three tetrahedra. The axis has an edge whose ring is all
 * sectors. */
static void make_cylinder(struct tetmesh *mesh, uint32_t sectors, uint32_t layers)
{
    uint32_t side = sectors + 1;
    *mesh = (struct tetmesh){.vertex_count = side * (layers + 1), .position_type = TETLOD_FLOAT64};
    mesh->positions = array_new(mesh->vertex_count, 24);
    mesh->corners = array_new((size_t)3 * sectors * layers, 16);
    REQUIRE(mesh->positions && mesh->corners && tetmesh_add_field(mesh, "s", 1, TETLOD_FLOAT64, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        double angle = 6.283185307179586 * (v % side) / sectors, *p = mesh->positions + 3 * (size_t)v;
        p[0] = v % side < sectors ? cos(angle) : 0;
        p[1] = v % side < sectors ? sin(angle) : 0;
        p[2] = v / side;
        mesh->fields[0].values[v] = p[0] + 2 * p[2];
    }
    for (uint32_t i = 0; i < sectors * layers; i++) {
        uint32_t base = i / sectors * side, s = i % sectors, next = (s + 1) % sectors, low = s < next ? s : next,
                 high = s < next ? next : s;
        const uint32_t path[6] = {base + low, base + high, base + sectors, base + side + low, base + side + high,
                                  base + side + sectors};
        const uint32_t tets[3][4] = {{path[0], path[1], path[2], path[5]}, {path[0], path[1], path[4], path[5]},
                                     {path[0], path[3], path[4], path[5]}};
        memcpy(mesh->corners + 4 * (size_t)mesh->tet_count, tets, sizeof tets);
        mesh->tet_count += 3;
    }
    for (size_t t = 0; t < mesh->tet_count; t++) {
        uint32_t *c = mesh->corners + 4 * t, swap = c[2];
        const double *p = mesh->positions;
        if (tet_volume6(p + 3 * (size_t)c[0], p + 3 * (size_t)c[1], p + 3 * (size_t)c[2], p + 3 * (size_t)c[3]) > 0)
            continue;
        c[2] = c[3];
        c[3] = swap;
    }
}

static void test_rings_of_any_size(void)
{
    static const uint32_t sectors[] = {6, 60, 70, 200, 2000};
    for (int i = 0; i < 5; i++) {
        struct tetmesh mesh;
        struct contraction_log log;
        make_cylinder(&mesh, sectors[i], 5);
        struct simplify_options options = usual(&mesh, 2);
        options.boundary_limit *= 1e-6; // the rim stays
        REQUIRE(rounds_simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
        CHECK_INT(log.inverted_tets + log.degenerate_tets + log.folded_tets, 0);
        printf("# %u sectors: %u of %u tetrahedra are left\n", sectors[i], log.marks[log.mark_count - 1].tets,
               mesh.tet_count);
        CHECK(log.marks[log.mark_count - 1].tets <= 3 * sectors[i] + 2); // one layer
        log_fini(&log);
        tetmesh_fini(&mesh);
    }
}

/* The sequence of the other metrics has no caps either. */
static void test_rings_in_sequence(void)
{
    for (uint32_t sectors = 60; sectors < 400; sectors += 150) {
        struct tetmesh mesh;
        struct contraction_log log;
        make_cylinder(&mesh, sectors, 5);
        struct simplify_options options = usual(&mesh, 1);
        options.metric = METRIC_SVA;
        options.boundary_limit *= 1e-6;
        REQUIRE(simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
        printf("# %u sectors: %u of %u tetrahedra are left\n", sectors, log.marks[log.mark_count - 1].tets,
               mesh.tet_count);
        CHECK(log.marks[log.mark_count - 1].tets <= 3 * sectors + 2);
        log_fini(&log);
        tetmesh_fini(&mesh);
    }
}

/* ---- how far the boundary may move */

/* A slot's clearance is that of its vertex, whatever order the slots are in. */
static void test_clearance_by_slot(void)
{
    struct tetmesh mesh;
    struct contraction_log log;
    struct working working;
    struct border border;
    struct pool *pool = pool_new(1);
    uint32_t differ = 0;
    REQUIRE(pool && sample_find("torus")->make(&mesh, 3, NULL) == TETLOD_OK);
    REQUIRE(log_init(&log, &mesh, NULL) == TETLOD_OK);
    REQUIRE(working_init(&working, &mesh, NULL, (uint32_t[]){0}, 1, NULL, &log, NULL) == TETLOD_OK);
    REQUIRE(border_find(&working, pool, NULL) == TETLOD_OK);
    double limit = mesh_diagonal(&mesh), *most = array_new(mesh.vertex_count, sizeof *most);
    uint32_t *triangles = array_new(mesh.tet_count, 12 * sizeof *triangles);
    struct clearance_mesh whole = {mesh.positions, mesh.corners, triangles, mesh.vertex_count, mesh.tet_count, 0};
    REQUIRE(most && triangles);
    for (uint32_t t = 0; t < working.tet_count; t++)
        for (unsigned f = 0; f < 4; f++)
            for (int k = 0; k < 3 && working.boundary_faces[t] >> f & 1; k++)
                triangles[whole.triangle_count++] = working.node[working.corners[t][tet_faces[f][k]]];
    whole.triangle_count /= 3;
    REQUIRE(clearance_find(&whole, limit, 1e-12, 1, most, NULL) == TETLOD_OK);
    REQUIRE(border_init(&border, &working, &mesh, 30, limit, 1e-12, 1, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        CHECK(border.most[v] == most[working.node[v]]);
        differ += most[working.node[v]] != most[v];
    }
    CHECK(differ > mesh.vertex_count / 4);
    free(most);
    free(triangles);
    border_fini(&border);
    working_fini(&working);
    log_fini(&log);
    pool_free(pool);
    tetmesh_fini(&mesh);
}

/* ---- what the boundary map demands */

/* The pyramid's middle goes to a corner. The value that it had is then the mean of that corner's
 * and the one across; the bound covers it from above and from below. */
static void test_the_map_is_heard(void)
{
    const double values[6] = {7, 3, 2, 5, 2, 0};
    for (int sign = -1; sign <= 1; sign += 2) {
        struct pyramid pyramid;
        struct contraction_log log;
        pyramid_init(&pyramid);
        struct tetmesh mesh = pyramid.mesh;
        REQUIRE(tetmesh_add_field(&mesh, "s", 1, TETLOD_FLOAT64, NULL) == TETLOD_OK);
        for (int v = 0; v < 6; v++)
            mesh.fields[0].values[v] = sign * values[v];
        struct simplify_options options = usual(&mesh, 1);
        options.boundary_limit = 1;
        options.boundary_least = 1;
        REQUIRE(rounds_simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
        CHECK_INT(log.count, 1);
        uint32_t other = log.children[0] ? log.children[0] : log.children[1], across = (other + 1) % 4 + 1;
        double there = (log.fields[0].values[0] + sign * values[across]) / 2;
        printf("# to corner %u: %g instead of %g, certified %g\n", other, there, sign * values[0],
               7 * log.certified[(log.mark_count - 1) * log.component_count]);
        CHECK(other >= 1 && other <= 4 &&
              fabs(there - sign * values[0]) <= 7 * log.certified[(log.mark_count - 1) * log.component_count] + 1e-12);
        log_fini(&log);
        point_field_fini(&mesh.fields[0]);
        free(mesh.fields);
    }
}

/* ---- stopping */

static bool stop_at(void *opaque, double done)
{
    unsigned *left = opaque;
    CHECK(done >= 0 && done <= 1);
    return *left && --*left;
}

static void test_stops_where_told(void)
{
    struct tetmesh mesh;
    struct contraction_log log;
    REQUIRE(sample_find("cube")->make(&mesh, 8, NULL) == TETLOD_OK);
    struct simplify_options options = usual(&mesh, 2);
    options.min_tets = 900;
    REQUIRE(rounds_simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    uint32_t last = log.marks[log.mark_count - 1].tets;
    CHECK(last <= 900 && last > 850);
    log_fini(&log);
    for (unsigned calls = 1; calls < 40; calls += 7) {
        unsigned left = calls;
        struct tetlod_error error;
        options.progress = stop_at;
        options.progress_opaque = &left;
        CHECK_INT(rounds_simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, &error), TETLOD_ERR_CANCELLED);
    }
    tetmesh_fini(&mesh);
}

/* A cube's corners and a linear field are such that every interpolant is exact: what is certified is what it was
 * widened by. Without that, nothing would be left of the bound's own rounding (PROOF.md, 4). */
static void test_bounds_are_widened(void)
{
    struct tetmesh mesh;
    struct contraction_log log;
    REQUIRE(sample_find("cube")->make(&mesh, 8, NULL) == TETLOD_OK);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh.fields[0].values[v] = 1024 * mesh.positions[3 * (size_t)v] - 256 * mesh.positions[3 * (size_t)v + 1];
    struct simplify_options options = usual(&mesh, 1);
    options.min_tets = mesh.tet_count / 4; // later, middles of middles are rounded to float32
    REQUIRE(rounds_simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    double certified = log.certified[(log.mark_count - 1) * log.component_count];
    printf("# %u contractions, certified %g\n", log.count, certified);
    CHECK(log.count > 300);
    CHECK(certified > 1e-13 && certified < 1e-8);
    log_fini(&log);
    tetmesh_fini(&mesh);
}

int main(void)
{
    RUN(test_threads_do_not_matter);
    RUN(test_either_arithmetic);
    RUN(test_rings_of_any_size);
    RUN(test_rings_in_sequence);
    RUN(test_clearance_by_slot);
    RUN(test_the_map_is_heard);
    RUN(test_stops_where_told);
    RUN(test_bounds_are_widened);
    return test_end();
}
