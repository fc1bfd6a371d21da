/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * A unit test program: functions run by RUN, checks that print both values, TAP on standard output for tests/run.py.
 *
 *     static void test_add(void) { CHECK_INT(add(1, 2), 3); }
 *     int main(void) { RUN(test_add); return test_end(); }
 */
#ifndef TETLOD_TEST_H
#define TETLOD_TEST_H

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Many times slower, and each path is wanted once: numbers of many meshes are held without. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1
#else
#define SANITIZED 0
#endif

static int test_count, test_failures, test_failed_here;
static const char *test_skipped;

#define RUN(function)                                                                                                  \
    do {                                                                                                               \
        test_failed_here = 0;                                                                                          \
        test_skipped = NULL;                                                                                           \
        function();                                                                                                    \
        test_failures += test_failed_here != 0;                                                                        \
        printf("%s %d - %s%s%s\n", test_failed_here ? "not ok" : "ok", ++test_count, #function,                        \
               test_skipped ? " # SKIP " : "", test_skipped ? test_skipped : "");                                      \
        fflush(stdout);                                                                                                \
    } while (0)

/* Leaves the test function: what it needs is not there. */
#define SKIP(why)                                                                                                      \
    do {                                                                                                               \
        test_skipped = why;                                                                                            \
        return;                                                                                                        \
    } while (0)

#define TEST_FAIL(...)                                                                                                 \
    do {                                                                                                               \
        test_failed_here++;                                                                                            \
        printf("# %s:%d: ", __FILE__, __LINE__);                                                                       \
        printf(__VA_ARGS__);                                                                                           \
        printf("\n");                                                                                                  \
    } while (0)

#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition))                                                                                              \
            TEST_FAIL("%s", #condition);                                                                               \
    } while (0)

/* Leaves the test function where going on makes no sense. */
#define REQUIRE(condition)                                                                                             \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            TEST_FAIL("%s", #condition);                                                                               \
            return;                                                                                                    \
        }                                                                                                              \
    } while (0)

#define CHECK_INT(got, wanted)                                                                                         \
    do {                                                                                                               \
        long long got_ = (long long)(got), wanted_ = (long long)(wanted);                                              \
        if (got_ != wanted_)                                                                                           \
            TEST_FAIL("%s is %lld, not %lld", #got, got_, wanted_);                                                    \
    } while (0)

#define CHECK_NEAR(got, wanted, tolerance)                                                                             \
    do {                                                                                                               \
        double got_ = (got), wanted_ = (wanted);                                                                       \
        if (!(fabs(got_ - wanted_) <= (tolerance)))                                                                    \
            TEST_FAIL("%s is %.17g, not %.17g", #got, got_, wanted_);                                                  \
    } while (0)

#define CHECK_TEXT(got, wanted)                                                                                        \
    do {                                                                                                               \
        const char *got_ = (got), *wanted_ = (wanted);                                                                 \
        if (!got_ || strcmp(got_, wanted_) != 0)                                                                       \
            TEST_FAIL("%s is \"%s\", not \"%s\"", #got, got_ ? got_ : "(null)", wanted_);                              \
    } while (0)

static inline int test_end(void)
{
    printf("1..%d\n", test_count);
    return test_failures != 0;
}

#endif
