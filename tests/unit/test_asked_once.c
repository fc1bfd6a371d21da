/* SPDX-License-Identifier: BSD-3-Clause */
/* What the exact limit has refused is not asked again within that limit, unless something has changed around it. */
#include "src/simplify/exact/examiner.h"

#include <stdlib.h>

#include "src/measure/measure.h"
#include "src/sample/sample.h"
#include "src/simplify/rounds/evaluate.h"
#include "src/simplify/simplify.h"
#include "tests/test.h"

/* A question, and a sum over the tetrahedra of its star by their nodes, which name vertices for good. */
struct query {
    uint32_t nodes[4], star;
    double p[3], limit;
};

static struct query *queries;
static size_t query_count, query_room;

static struct query query_of(const struct working *working, const struct star *star, const double p[3], double limit)
{
    struct query query;
    memset(&query, 0, sizeof query);
    for (uint32_t s = 0; s < star->simplex_count; s++)
        query.nodes[s] = working->node[star->simplex[s]] + 1;
    for (uint32_t i = 0; i < star->tet_count; i++) {
        uint32_t sum = 0, product = 1;
        for (int c = 0; c < 4; c++) {
            uint32_t node = working->node[working->corners[star->tets[i]][c]];
            sum += scramble(node);
            product *= 2 * node + 1;
        }
        query.star += scramble(sum ^ product);
    }
    memcpy(query.p, p, sizeof query.p);
    query.limit = limit;
    return query;
}

static void note(const struct working *working, const struct star *star, const double p[3], double limit)
{
    if (query_count == query_room) {
        query_room = 2 * query_room + 1024;
        queries = realloc(queries, query_room * sizeof *queries);
        REQUIRE(queries != NULL);
    }
    queries[query_count++] = query_of(working, star, p, limit);
}

/* What the builder calls in place of exact_examine (Makefile). Searches between candidates (`whole`) begin with one of
 * these on purpose. */
enum tetlod_status __wrap_exact_examine(struct examiner *examiner, const struct overlaps *overlaps,
                                        const struct working *working, const struct star *star, const double p[3],
                                        double limit, double cutoff, bool whole, struct finding *out,
                                        struct tetlod_error *error);
enum tetlod_status __real_exact_examine(struct examiner *examiner, const struct overlaps *overlaps,
                                        const struct working *working, const struct star *star, const double p[3],
                                        double limit, double cutoff, bool whole, struct finding *out,
                                        struct tetlod_error *error);

enum tetlod_status __wrap_exact_examine(struct examiner *examiner, const struct overlaps *overlaps,
                                        const struct working *working, const struct star *star, const double p[3],
                                        double limit, double cutoff, bool whole, struct finding *out,
                                        struct tetlod_error *error)
{
    if (!whole)
        note(working, star, p, limit);
    return __real_exact_examine(examiner, overlaps, working, star, p, limit, cutoff, whole, out, error);
}

static int compare_queries(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(struct query));
}

static void check_sample(const char *name, uint32_t size)
{
    struct tetmesh mesh = {0};
    struct contraction_log log;
    size_t repeated = 0;
    REQUIRE(sample_find(name)->make(&mesh, size, NULL) == TETLOD_OK);
    const struct simplify_options options = {.metric = METRIC_FIELD_QUADRIC,
                                             .certify = CERTIFY_EXACT,
                                             .contract = CONTRACT_EDGES,
                                             .max_error = 0.05,
                                             .min_tets = 1,
                                             .boundary_angle = 30,
                                             .boundary_limit = 1e-6 * mesh_diagonal(&mesh),
                                             .growth = 1.2,
                                             .threads = 1};
    query_count = 0;
    REQUIRE(simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    qsort(queries, query_count, sizeof *queries, compare_queries);
    for (size_t i = 1; i < query_count; i++)
        repeated += !compare_queries(&queries[i - 1], &queries[i]);
    printf("# %s %u: %zu queries, %zu of them again\n", name, size, query_count, repeated);
    CHECK(query_count > 1000);
    CHECK_INT(repeated, 0);
    log_fini(&log);
    tetmesh_fini(&mesh);
}

static void test_samples(void)
{
    check_sample("cube", 6);
    check_sample("fin", 8);
    check_sample("post", 10);
    check_sample("delta", 3);
    free(queries);
}

int main(void)
{
    RUN(test_samples);
    return test_end();
}
