/* SPDX-License-Identifier: BSD-3-Clause */
/* Numbers as few bytes come back as they were, whatever they are; bytes that are cut off or wrong are refused. */
#include "src/util/packed_words.h"

#include <stdlib.h>
#include <string.h>

#include "tests/gen.h"
#include "tests/test.h"

enum { COUNT = 5000, LAGS = 4 };

/* Numbers of all sizes: runs, small steps, noise in any of the bytes. */
static void fill(unsigned char *out, size_t count, unsigned width, uint64_t *random)
{
    uint64_t word = 0;
    for (size_t i = 0; i < count; i++) {
        uint64_t noise = gen_random(random), kind = noise % 41 ? noise >> 8 & 3 : 4;
        unsigned shift = (unsigned)(noise >> 16) % 64;
        word = kind == 0 ? word : kind == 1 ? word + (noise >> 60) : kind == 2 ? word ^ noise >> shift << shift / 2
             : kind == 3 ? noise : i % 2 ? UINT64_MAX : 0;
        memcpy(out + i * width, &word, width);
    }
    memset(out + width * (count / 2), 0, 100 * (size_t)width); // a run of several
}

static void check_same(const unsigned char *words, size_t count, unsigned width, unsigned lag)
{
    struct buffer bytes = {0};
    unsigned char *back = malloc(count * width + 1);
    REQUIRE(back && buffer_append(&bytes, "xy", 2) == TETLOD_OK && words_put(&bytes, words, count, width, lag));
    struct words_source source = {bytes.bytes + 2, bytes.size - 2};
    CHECK(words_fit(count, width, source.left));
    CHECK(words_get(&source, back, count, width, lag) && !source.left);
    CHECK(memcmp(back, words, count * width) == 0);
    for (size_t size = 0; size + 2 < bytes.size; size += 1 + size / 9) {
        source = (struct words_source){bytes.bytes + 2, size};
        CHECK(!words_get(&source, back, count, width, lag));
    }
    free(back);
    buffer_fini(&bytes);
}

static void test_round_trip(void)
{
    static const unsigned widths[] = {1, 4, 8};
    uint64_t random = 1;
    for (int w = 0; w < 3; w++)
        for (unsigned lag = 1; lag <= LAGS; lag++) {
            unsigned char *words = malloc(COUNT * (size_t)widths[w]);
            REQUIRE(words);
            fill(words, COUNT, widths[w], &random);
            check_same(words, COUNT, widths[w], lag);
            check_same(words, lag, widths[w], lag);
            free(words);
        }
    check_same((const unsigned char *)"", 0, 8, 1);
}

/* Numbers that are like each other take few bytes. */
static void test_small(void)
{
    uint32_t corners[400];
    double floats[400];
    struct buffer bytes = {0};
    for (uint32_t i = 0; i < 400; i++) {
        corners[i] = 100000 + i / 4 * 3 + i % 4 * 50;
        floats[i] = (double)(float)(1 + 0.001 * i);
    }
    REQUIRE(words_put(&bytes, corners, 400, 4, 4));
    CHECK(bytes.size < 400 + 20);
    bytes.size = 0;
    REQUIRE(words_put(&bytes, floats, 400, 8, 1));
    CHECK(bytes.size < 400 * 5);
    buffer_fini(&bytes);
}

static void test_wrong(void)
{
    static const unsigned char endless[] = {128, 128, 128, 128, 128, 0}, nine[] = {0x81, 0, 0, 0, 0, 0, 0, 0, 0, 0},
                               behind[] = {0x26, 1, 2, 3, 4}, many[] = {0x0f};
    uint64_t out[4];
    struct words_source source = {endless, sizeof endless};
    CHECK(!words_get(&source, out, 1, 4, 1));
    source = (struct words_source){nine, sizeof nine};
    CHECK(!words_get(&source, out, 1, 8, 1));
    source = (struct words_source){behind, sizeof behind};
    CHECK(words_get(&source, out, 1, 8, 1) && out[0] == UINT64_C(0x0201) << 48);
    source = (struct words_source){many, sizeof many};
    CHECK(!words_get(&source, out, 4, 8, 1));
}

int main(void)
{
    RUN(test_round_trip);
    RUN(test_small);
    RUN(test_wrong);
    return test_end();
}
