/* SPDX-License-Identifier: BSD-3-Clause */
/* What the exact limit has refused is not asked again within that limit, unless something has changed around it. */
#include "src/simplify/exact/exact.h"

#include <stdlib.h>

#include "src/measure/measure.h"
#include "src/sample/sample.h"
#include "src/simplify/simplify.h"
#include "tests/test.h"

/* A question, and when the star of one of its vertices had changed last. Nodes name the vertices, for slots are renumbered. */
struct question {
    uint32_t nodes[4], changed;
    double p[3], limit;
};

static struct question *questions;
static size_t question_count, question_room;

static struct question question_of(const struct complex *complex, const struct star *star, const double p[3], double limit)
{
    struct question question;
    memset(&question, 0, sizeof question);
    for (uint32_t s = 0; s < star->simplex_count; s++) {
        uint32_t slot = star->simplex[s];
        question.nodes[s] = complex->node[slot] + 1;
        question.changed = complex->changed[slot] > question.changed ? complex->changed[slot] : question.changed;
    }
    memcpy(question.p, p, sizeof question.p);
    question.limit = limit;
    return question;
}

static void note(const struct complex *complex, const struct star *star, const double p[3], double limit)
{
    if (question_count == question_room) {
        question_room = 2 * question_room + 1024;
        questions = realloc(questions, question_room * sizeof *questions);
        REQUIRE(questions != NULL);
    }
    questions[question_count++] = question_of(complex, star, p, limit);
}

/* What the builder calls in place of exact_examine (Makefile). Searches between candidates (`whole`) begin with one of these on purpose. */
enum tetlod_status __wrap_exact_examine(struct examiner *examiner, const struct overlaps *overlaps, const struct complex *complex,
                                        const struct fields *fields, const struct star *star, const double p[3], double limit,
                                        double cutoff, bool whole, struct finding *out, struct tetlod_error *error);
enum tetlod_status __real_exact_examine(struct examiner *examiner, const struct overlaps *overlaps, const struct complex *complex,
                                        const struct fields *fields, const struct star *star, const double p[3], double limit,
                                        double cutoff, bool whole, struct finding *out, struct tetlod_error *error);

enum tetlod_status __wrap_exact_examine(struct examiner *examiner, const struct overlaps *overlaps, const struct complex *complex,
                                        const struct fields *fields, const struct star *star, const double p[3], double limit,
                                        double cutoff, bool whole, struct finding *out, struct tetlod_error *error)
{
    if (!whole)
        note(complex, star, p, limit);
    return __real_exact_examine(examiner, overlaps, complex, fields, star, p, limit, cutoff, whole, out, error);
}

static int compare_questions(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(struct question));
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
    question_count = 0;
    REQUIRE(simplify(&log, &mesh, (uint32_t[]){0}, 1, NULL, &options, NULL) == TETLOD_OK);
    qsort(questions, question_count, sizeof *questions, compare_questions);
    for (size_t i = 1; i < question_count; i++)
        repeated += !compare_questions(&questions[i - 1], &questions[i]);
    printf("# %s %u: %zu questions, %zu of them again\n", name, size, question_count, repeated);
    CHECK(question_count > 1000);
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
    free(questions);
}

int main(void)
{
    RUN(test_samples);
    return test_end();
}
