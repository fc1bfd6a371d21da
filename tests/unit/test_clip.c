/* SPDX-License-Identifier: BSD-3-Clause */
/* Parts of a tetrahedron: what each function keeps and what it takes away are together what was there. */
#include "src/ask/clip.h"

#include <math.h>
#include <string.h>

#include "tests/gen.h"
#include "tests/test.h"

enum { TRIES = 400 };

/* Of all parts on either side of each function: shares, and integrals of what has `at` at the corners. */
static void add_up(const double (*functions)[4], unsigned count, const double at[4], double out[2])
{
    static struct clipped part;
    double values[MAX_CLIP_CORNERS];
    for (unsigned sides = 0; sides < 1u << count; sides++) {
        double own[MAX_CLIP_PLANES][4];
        for (unsigned k = 0; k < count; k++)
            for (int c = 0; c < 4; c++)
                own[k][c] = sides >> k & 1 ? -functions[k][c] : functions[k][c];
        clip_tet((const double(*)[4])own, count, &part);
        for (unsigned v = 0; v < part.count; v++)
            values[v] = clip_value(at, part.weights[v]);
        out[0] += part.share;
        out[1] += clip_integral(&part, values);
    }
}

static void test_both_sides(void)
{
    uint64_t state = 7;
    for (unsigned n = 0; n < TRIES; n++) {
        const unsigned count = 1 + n % MAX_CLIP_PLANES;
        double functions[MAX_CLIP_PLANES][4], at[4], sums[2] = {0, 0};
        for (unsigned k = 0; k < count; k++)
            for (int c = 0; c < 4; c++)
                functions[k][c] = gen_unit(&state) - 0.5;
        for (int c = 0; c < 4; c++)
            at[c] = gen_unit(&state);
        add_up((const double(*)[4])functions, count, at, sums);
        CHECK_NEAR(sums[0], 1, 1e-12);
        CHECK_NEAR(sums[1], (at[0] + at[1] + at[2] + at[3]) / 4, 1e-12);
    }
}

/* Functions that are 0 at corners, along edges, and the same as others: none but those that are 0 everywhere keep a
 * place on both sides that has a volume. */
static void test_through_corners(void)
{
    uint64_t state = 11;
    for (unsigned n = 0; n < TRIES; n++) {
        const unsigned count = 1 + n % 5;
        double functions[MAX_CLIP_PLANES][4], sums[2] = {0, 0}, share = 1;
        for (unsigned k = 0; k < count; k++) {
            double size = 0;
            for (int c = 0; c < 4; c++)
                size += fabs(functions[k][c] = (double)(gen_random(&state) % 3) - 1);
            share *= size > 0 ? 1 : 2;
        }
        add_up((const double(*)[4])functions, count, (const double[4]){1, 1, 1, 1}, sums);
        CHECK_NEAR(sums[0], share, 1e-12);
    }
}

/* Where rounding alone decides which corner is on which side, there are no more corners than there is room for. */
static void test_rounding(void)
{
    static struct clipped part;
    uint64_t state = 13;
    for (unsigned n = 0; n < 50 * TRIES; n++) {
        double functions[MAX_CLIP_PLANES][4];
        const double mean = 0.25 * (gen_unit(&state) - 0.5);
        for (unsigned k = 0; k < MAX_CLIP_PLANES; k++)
            for (int c = 0; c < 4; c++)
                functions[k][c] = (k % 2 ? 1 : -1) * (c == 0 ? mean : c == 1 ? -mean : mean * (c - 2.5)) +
                    1e-17 * (gen_unit(&state) - 0.5);
        clip_tet((const double(*)[4])functions, MAX_CLIP_PLANES, &part);
        CHECK(part.count <= MAX_CLIP_CORNERS && part.piece_count <= 2 * MAX_CLIP_CORNERS);
        CHECK(part.share >= 0 && part.share <= 1 + 1e-9);
    }
}

static void test_share_below(void)
{
    static struct clipped part;
    uint64_t state = 17;
    for (unsigned n = 0; n < TRIES; n++) {
        double values[4], plane[1][4], threshold = n % 3 ? gen_unit(&state) : 0.5;
        for (int c = 0; c < 4; c++)
            values[c] = n % 3 ? gen_unit(&state) : 0.5 * (double)(gen_random(&state) % 3);
        for (int c = 0; c < 4; c++)
            plane[0][c] = threshold - values[c];
        clip_tet((const double(*)[4])plane, 1, &part);
        clip_sort(values);
        CHECK(values[0] <= values[1] && values[1] <= values[2] && values[2] <= values[3]);
        CHECK_NEAR(clip_share_below(values, threshold), part.share, 1e-13);
    }
    const double flat[4] = {1, 1, 1, 1};
    CHECK(clip_share_below(flat, 1) == 1 && clip_share_below(flat, 0.9) == 0);
}

int main(void)
{
    RUN(test_both_sides);
    RUN(test_through_corners);
    RUN(test_rounding);
    RUN(test_share_below);
    return test_end();
}
