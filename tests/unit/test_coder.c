/* SPDX-License-Identifier: BSD-3-Clause */
/* The parts of the codec by themselves: checksums against published values, numbers as codes, the range coder. */
#include <float.h>
#include <stdlib.h>

#include "format/common/checksum.h"
#include "format/common/coder.h"
#include "format/common/pack.h"
#include "format/common/values.h"
#include "tests/gen.h"
#include "tests/test.h"

/* FIPS 180-4's examples, and any length in one piece and in several. */
static void test_sha256(void)
{
    static const uint8_t abc[16] = {0xba, 0x78, 0x16, 0xbf, 0x8f, 0x01, 0xcf, 0xea, 0x41, 0x41, 0x40, 0xde, 0x5d, 0xae,
                                    0x22, 0x23};
    static const uint8_t two_blocks[16] = {0x24, 0x8d, 0x6a, 0x61, 0xd2, 0x06, 0x38, 0xb8, 0xe5, 0xc0, 0x26, 0x93,
                                           0x0c, 0x3e, 0x60, 0x39};
    uint8_t bytes[300], whole[32], pieces[32];
    tetlodi_digest("abc", 3, whole);
    CHECK(memcmp(whole, abc, sizeof abc) == 0);
    tetlodi_digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 56, whole);
    CHECK(memcmp(whole, two_blocks, sizeof two_blocks) == 0);
    for (size_t size = 0, wrong = 0; size < sizeof bytes; size++) {
        struct tetlodi_sha256 sha;
        bytes[size] = (uint8_t)(size * 7);
        tetlodi_sha256_init(&sha);
        for (size_t at = 0, piece = 1; at < size; at += piece, piece = piece * 3 % 97 + 1)
            tetlodi_sha256_add(&sha, bytes + at, size - at < piece ? size - at : piece);
        tetlodi_sha256_finish(&sha, pieces);
        tetlodi_digest(bytes, size, whole);
        wrong += memcmp(whole, pieces, DIGEST_SIZE) != 0;
        if (size + 1 == sizeof bytes)
            CHECK_INT(wrong, 0);
    }
}

static void fill(uint8_t *bytes, size_t size, unsigned kind)
{
    uint32_t random = 1;
    for (size_t i = 0; i < size; i++) {
        random = random * 1664525 + 1013904223;
        bytes[i] = (uint8_t)(kind == 0 ? 0 : kind == 1 ? i / 24 % 3 : kind == 2 ? random >> 24 : i % 8 ? 7
                             : random >> 24);
    }
}

/* What is packed comes back, noise is not packed, and bytes of any kind unpack to something. */
static void test_packing(void)
{
    uint8_t bytes[5000], back[5000];
    for (unsigned kind = 0; kind < 4; kind++)
        for (uint32_t stride = 1; stride < 200; stride += 1 + stride / 2) {
            struct tetlodi_buffer packed = {0};
            size_t size = sizeof bytes - stride % 7;
            fill(bytes, size, kind);
            bool smaller = tetlodi_pack(PACKED_VALUES, bytes, size, stride, &packed);
            CHECK(smaller || kind == 0 || kind == 2);
            CHECK(!smaller || kind != 2);
            CHECK(!smaller || (packed.size < size &&
                               tetlodi_unpack(packed.bytes, packed.size, back, size, NULL) == TETLOD_OK &&
                               memcmp(bytes, back, size) == 0));
            CHECK_INT(packed.size < 4 || tetlodi_unpack(packed.bytes, 4, back, sizeof back, NULL) == TETLOD_OK, 1);
            tetlodi_buffer_fini(&packed);
        }
    CHECK_INT(tetlodi_unpack(bytes, 2, back, 10, NULL), TETLOD_ERR_STREAM);
    CHECK_INT(tetlodi_unpack((const uint8_t *)"\0\0\0abc", 6, back, 10, NULL), TETLOD_ERR_STREAM);
    CHECK_INT(tetlodi_unpack((const uint8_t *)"\0\0\1abc", 6, back, 10, NULL), TETLOD_ERR_STREAM);
}

/* In order, with every bit: the least floats, both zeros, the greatest. */
static void test_codes_of_floats(void)
{
    static const double values[] = {-DBL_MAX, -FLT_MAX, -1.5, -FLT_MIN, -1.40129846432481707e-45, -0.0, 0.0,
                                    1.40129846432481707e-45, FLT_MIN, 1, 1.00000011920928955, FLT_MAX, DBL_MAX};
    for (int wide = 0; wide < 2; wide++) {
        struct tetlodi_scale scale = {.type = wide ? TETLOD_FLOAT64 : TETLOD_FLOAT32};
        int count = sizeof values / sizeof *values;
        int64_t last = INT64_MIN;
        for (int i = wide ? 0 : 1; i < count - !wide; i++) {
            int64_t code = scale_code(&scale, 0, values[i]);
            double back = scale_value(&scale, 0, code);
            CHECK_INT(memcmp(&back, &values[i], sizeof back), 0);
            CHECK(code > last);
            last = code;
        }
        CHECK_INT(scale_code(&scale, 0, -0.0), -1);
        CHECK_INT(scale_code(&scale, 0, 0.0), 0);
    }
}

static void test_codes_of_steps(void)
{
    struct tetlodi_scale scale = {.type = TETLOD_FLOAT64, .bits = 8, .origin = {-1}, .step = {0.25}};
    CHECK_INT(scale_code(&scale, 0, -1), 0);
    CHECK_INT(scale_code(&scale, 0, -0.7), 1);
    CHECK_INT(scale_code(&scale, 0, 1e300), 255);
    CHECK_INT(scale_code(&scale, 0, -1e300), 0);
    CHECK_NEAR(scale_value(&scale, 0, 255), 62.75, 0);
}

/* Whatever two codes are, the difference leads from one to the other. */
static void test_rings(void)
{
    static const int64_t wide[] = {INT64_MIN, -1, 0, 1, INT64_MAX}, narrow[] = {INT32_MIN, -1, 0, 1, INT32_MAX};
    struct tetlodi_scale scales[3] = {{.type = TETLOD_FLOAT64}, {.type = TETLOD_FLOAT32}, {.bits = 5}};
    for (int a = 0; a < 5; a++)
        for (int b = 0; b < 5; b++) {
            CHECK_INT(code_offset(wide[a], code_difference(wide[b], wide[a], 64), &scales[0]), wide[b]);
            CHECK_INT(code_offset(narrow[a], code_difference(narrow[b], narrow[a], 32), &scales[1]), narrow[b]);
            CHECK_INT(code_offset(7 * a, code_difference(7 * b, 7 * a, 5), &scales[2]), 7 * b);
        }
}

enum { COUNT = 20000 };

static int64_t value_of(uint64_t *random)
{
    uint64_t r = gen_random(random);
    int64_t magnitude = (int64_t)(gen_random(random) >> 1 >> (r & 63));
    return r >> 63 ? magnitude : -magnitude;
}

/* Codes COUNT of each kind, or checks that they come back. */
static uint32_t code_all(struct tetlodi_coder *coder, uint64_t random)
{
    struct tetlodi_number *models = calloc(1, sizeof *models);
    struct tetlodi_bit bits[16];
    uint32_t wrong = 0;
    tetlodi_number_init(models);
    tetlodi_bits_init(bits, 16);
    for (int i = 0; i < COUNT; i++) {
        int64_t value = value_of(&random);
        int rare = gen_random(&random) % 4096 == 0;
        unsigned plain = (unsigned)(gen_random(&random) & 0x7ff);
        wrong += code_number(coder, models, 3, coder->encoder ? value : 0) != value;
        wrong += code_bit(coder, &bits[0], coder->encoder ? rare : 0) != rare;
        wrong += code_plain(coder, 11, coder->encoder ? plain : 0) != plain;
        wrong += code_tree(coder, bits, 3, coder->encoder ? plain & 7 : 0) != (plain & 7);
    }
    free(models);
    return wrong;
}

static void test_range_coder(void)
{
    for (unsigned slowest = 5; slowest <= 7; slowest++) {
        struct tetlodi_memory memory = {.most = UINT64_MAX};
        struct tetlodi_coder coder, decoder;
        struct tetlodi_encoder encoder = {0};
        tetlodi_encode_start(&coder, slowest, &encoder, &memory);
        CHECK_INT(code_all(&coder, slowest), 0);
        tetlodi_encode_finish(&coder);
        tetlodi_decode_start(&decoder, slowest, encoder.bytes, encoder.size);
        CHECK_INT(code_all(&decoder, slowest), 0);
        CHECK_INT(decoder.bad, 0);
        TETLODI_FREE(&memory, encoder.bytes, encoder.capacity);
        CHECK_INT(memory.used, 0);
    }
}

/* However sure a model is, it can be wrong: no bit is impossible, in particular at the fastest rate. */
static void test_surprises(void)
{
    for (unsigned slowest = 5; slowest <= 7; slowest++)
        for (int usual = 0; usual < 2; usual++) {
            struct tetlodi_memory memory = {.most = 1 << 20};
            struct tetlodi_coder coders[2];
            struct tetlodi_encoder encoder = {0};
            int wrong = 0;
            for (int k = 0; k < 2; k++) {
                struct tetlodi_bit model;
                tetlodi_bits_init(&model, 1);
                if (k)
                    tetlodi_decode_start(&coders[1], slowest, encoder.bytes, encoder.size);
                else
                    tetlodi_encode_start(&coders[0], slowest, &encoder, &memory);
                for (int i = 0; i < 5000; i++) {
                    int bit = i % 2500 == 2499 ? !usual : usual;
                    wrong += code_bit(&coders[k], &model, bit) != bit;
                }
                if (!k)
                    tetlodi_encode_finish(&coders[0]);
            }
            CHECK_INT(wrong, 0);
            CHECK_INT(encoder.failed, 0);
            TETLODI_FREE(&memory, encoder.bytes, encoder.capacity);
        }
}

/* No encoder's code reaches the range: neither at the start, nor where plain bits would be more than there is room
 * for. */
static void test_refused(void)
{
    const uint8_t equal[] = {0xff, 0xff, 0xff, 0xff}, below[] = {0xff, 0xff, 0xff, 0xfe};
    struct tetlodi_coder coder;
    struct tetlodi_bit bit;
    tetlodi_decode_start(&coder, 6, equal, sizeof equal);
    CHECK(coder.bad);
    tetlodi_decode_start(&coder, 6, below, sizeof below);
    CHECK_INT(coder.bad, 0);
    tetlodi_bits_init(&bit, 1);
    CHECK_INT(code_bit(&coder, &bit, 0), 1);
    code_plain(&coder, 10, 0);
    CHECK(coder.bad);
    tetlodi_decode_start(&coder, 6, below, sizeof below);
    code_plain(&coder, 8, 0);
    CHECK(coder.bad);
    tetlodi_decode_start(&coder, 6, equal, 2);
    CHECK_INT(code_plain(&coder, 8, 0), 255);
    CHECK_INT(coder.bad, 0);
}

/* A million bits that are expected cost next to nothing. */
static void test_costs(void)
{
    struct tetlodi_memory memory = {.most = UINT64_MAX};
    struct tetlodi_coder coder;
    struct tetlodi_encoder encoder = {0};
    struct tetlodi_bit bit;
    tetlodi_bits_init(&bit, 1);
    tetlodi_encode_start(&coder, 7, &encoder, &memory);
    for (int i = 0; i < 1000000; i++)
        code_bit(&coder, &bit, 0);
    tetlodi_encode_finish(&coder);
    CHECK(encoder.size < 400);
    TETLODI_FREE(&memory, encoder.bytes, encoder.capacity);
}

int main(void)
{
    RUN(test_sha256);
    RUN(test_packing);
    RUN(test_codes_of_floats);
    RUN(test_codes_of_steps);
    RUN(test_rings);
    RUN(test_range_coder);
    RUN(test_surprises);
    RUN(test_refused);
    RUN(test_costs);
    return test_end();
}
